"""Whether the noise model is true, and what to believe where it is not.

The residuals are tested against the covariances given; where they fail, the covariances become `S_k = s (Sp + R Sq
R') + diag(bx, by, bz)` under Student's t with nu degrees of freedom, all five by maximum likelihood: a common factor,
noise that was left out along each target axis (the norm-bounded form with its bound learnt instead of given), and a
share of pairs much worse than told. Variance components by Fisher scoring: C. R. Rao, J. Multivariate Analysis 1,
1971; t weights: K. Lange, R. Little and J. Taylor, "Robust statistical modeling using the t distribution", J. Am.
Stat. Assoc. 84, 1989.
"""

import math
from dataclasses import dataclass
from enum import Enum, unique

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.special import gammaln

from odom.registration.kernels import precisions
from odom.registration.pairs import Prior
from odom.registration.solve import Arrays, Solution, solve

Array = NDArray[np.float64]

_SIGNIFICANT = 5.0
_NU = np.array([0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 9.0, 15.0, 30.0, np.inf])
_NO_COVARIANCES = np.empty((0, 3, 3))
_MAX_ROUNDS = 40
_SPREAD_SIGMA = 2.0


@unique
class Model(Enum):
    """What the residuals say of the covariances."""

    HOLDS = "true"
    SCALED = "true but for a common factor"
    WRONG = "wrong"


def judge_model(solution: Solution) -> Model:
    """Return whether the residuals are what the covariances promise, within five sigma of chance.

    Tested are the mean of chi2 and, relative to it, its spread (pairs much worse or better than told) and each target
    axis.
    """
    n, chi2, squares, *axes = solution.sums.tolist()
    freedom = 3.0 * n - 6.0
    if freedom <= 0.0:
        return Model.HOLDS
    allowed = _SIGNIFICANT * math.sqrt(2.0 / freedom)
    spread = n * squares / chi2**2  # 15 / 9 for chi-square (3)
    factor = chi2 / freedom
    if abs(spread - 15.0 / 9.0) > _SIGNIFICANT * _SPREAD_SIGMA / math.sqrt(n):
        return Model.WRONG
    if max(abs(3.0 * s / freedom / factor - 1.0) for s in axes) > math.sqrt(3.0) * allowed:
        return Model.WRONG
    return Model.HOLDS if abs(factor - 1.0) < allowed else Model.SCALED


@dataclass(frozen=True, eq=False)
class Adapted:
    """The covariances that explain the residuals, and the recursion's solution with them.

    `factor` is s, `added` (3) the variances bx, by, bz (m^2, target axes), `nu` the degrees of freedom (inf:
    Gaussian).
    """

    solution: Solution
    factor: float
    added: Array
    nu: float


def adapt(arrays: Arrays, prior: Prior | None, solution: Solution) -> Adapted:
    """Return the solution with the covariances of greatest likelihood, begun at `solution`."""
    given = solution.weights
    used = given > 0.0
    n = int(np.count_nonzero(used))
    small_sample = 3.0 * n / (3.0 * n - 6.0)
    base = _target_covariances(arrays, solution.T)
    T = solution.T
    factor = max(float(np.median(solution.chi2[used])) / 2.366, 1e-6)  # the median of chi-square (3)
    added = np.full(3, 0.1 * factor * float(np.einsum("nii->n", base[used]).mean()) / 3.0)
    nu = np.inf
    W = np.empty((len(arrays.q), 8))
    for round_ in range(_MAX_ROUNDS):
        S = factor * base + np.diag(added)
        precisions(_NO_COVARIANCES, S, T, 0.0, W)
        r = _residuals(arrays, T)
        u = _weighted(W, r)
        chi2 = np.einsum("ni,ni->n", u, r)
        if round_ % 3 == 2:
            nu = _degrees_of_freedom(chi2[used])
        t = (nu + 3.0) / (nu + chi2) if nu < np.inf else np.ones(len(chi2))
        inner = Arrays(arrays.q, arrays.p, _NO_COVARIANCES, S, arrays.weights)
        now = solve(inner, prior, T, given * t)
        if not now.determined:
            break
        T, solution = now.T, now
        full = W[used][:, (0, 1, 2, 1, 3, 4, 2, 4, 5)].reshape(-1, 3, 3)
        shares, previous = _scoring(full, base[used], u[used], t[used] * small_sample), np.append(added, factor)
        factor, added = float(shares[0]), shares[1:]
        if round_ > 5 and np.abs(np.append(added, factor) - previous).max() < 1e-3 * previous.max():
            break
    return Adapted(solution, factor, added, nu)


def _scoring(W: Array, V: Array, u: Array, t: Array) -> Array:
    """Return the shares (s, bx, by, bz) >= 0 after a step of Fisher scoring.

    `F share = form`, with F twice the information of the shares; `W` (n x 3 x 3) are the precisions now, `V` the
    given covariances, `u = W r`, `t` the pairs' weights.
    """
    WV = W @ V
    F = np.empty((4, 4))
    F[0, 0] = np.einsum("nij,nji->", WV, WV)
    F[0, 1:] = F[1:, 0] = np.einsum("nij,nji->i", WV, W)
    F[1:, 1:] = np.einsum("nij,nij->ij", W, W)
    form = np.concatenate([[np.einsum("n,ni,nij,nj->", t, u, V, u)], t @ (u * u)])
    scale = 1.0 / np.sqrt(F.diagonal())
    L = np.linalg.cholesky(F * scale[:, None] * scale + 1e-12 * np.eye(4))
    share, _ = nnls(L.T, np.linalg.solve(L, form * scale))
    share = share * scale
    share[0] = max(share[0], 1e-6)
    return np.asarray(share)


def _residuals(arrays: Arrays, T: Array) -> Array:
    return np.asarray(arrays.p - arrays.q @ T[:3, :3].T - T[:3, 3])


def _weighted(W: Array, r: Array) -> Array:
    """Return inv(S) r (n x 3) for packed precisions W."""
    return np.stack(
        [
            W[:, 0] * r[:, 0] + W[:, 1] * r[:, 1] + W[:, 2] * r[:, 2],
            W[:, 1] * r[:, 0] + W[:, 3] * r[:, 1] + W[:, 4] * r[:, 2],
            W[:, 2] * r[:, 0] + W[:, 4] * r[:, 1] + W[:, 5] * r[:, 2],
        ],
        axis=1,
    )


def _target_covariances(arrays: Arrays, T: Array) -> Array:
    """Return `Sp + R Sq R'` (n x 3 x 3)."""
    S = np.zeros((len(arrays.q), 3, 3)) if len(arrays.Sp) == 0 else arrays.Sp.copy()
    if len(arrays.Sq):
        S += T[:3, :3] @ arrays.Sq @ T[:3, :3].T
    return S


def _degrees_of_freedom(chi2: Array) -> float:
    """Return the nu of greatest likelihood for squared residuals of a trivariate t, from a table."""
    finite = _NU[:-1, None]
    log_t = gammaln((finite + 3.0) / 2.0) - gammaln(finite / 2.0) - 1.5 * np.log(finite / 2.0)
    likelihood = (log_t - (finite + 3.0) / 2.0 * np.log1p(chi2 / finite)).sum(axis=1)
    gaussian = -0.5 * float(chi2.sum())
    best = int(np.argmax(likelihood))
    return float(_NU[best]) if likelihood[best] > gaussian + 2.0 else math.inf
