"""Tests whether the given covariances are true, and replaces them by estimated ones where they are not.

The residuals are tested against the covariances; where they fail, the covariances become `S_k = s (Sp + R Sq R') +
diag(bx, by, bz)` under Student's t with nu degrees of freedom, all five by maximum likelihood: a common factor, noise
that was left out along each target axis (the norm-bounded form of eqs. 26-27 with its bound learnt instead of given),
and a share of pairs much worse than stated. Variance components by Fisher scoring: C. R. Rao, J. Multivariate Analysis
1, 1971; t weights: K. Lange, R. Little and J. Taylor, "Robust statistical modeling using the t distribution", J. Am.
Stat. Assoc. 84, 1989.
"""

import math
from dataclasses import dataclass
from enum import Enum, unique

import numpy as np
from scipy.optimize import nnls
from scipy.special import gammaln

from odom.geometry.arrays import Array
from odom.registration.checked_arrays import NO_COVARIANCES, Arrays
from odom.registration.measurement_covariance import precisions
from odom.registration.pairs import Prior
from odom.registration.paper.tuning import TUNING
from odom.registration.solution import Solution, solve

_NU = np.array([0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 9.0, 15.0, 30.0])
"""Degrees of freedom that are tried, in even steps of the likelihood; beyond 30 the t distribution is Gaussian."""
_MEDIAN = 2.366
"""The median of chi-square with 3 degrees of freedom."""
_GAIN = 2.0
"""Log-likelihood that heavy tails must gain over a Gaussian: about half the .95 quantile of chi-square (1)."""
FULL = (0, 1, 2, 1, 3, 4, 2, 4, 5)
"""Where the nine entries of a symmetric matrix stand among the packed six."""


@unique
class CovarianceVerdict(Enum):
    """What the residuals say of the covariances."""

    HOLDS = "true"
    SCALED = "true but for a common factor"
    WRONG = "wrong"


def judge_covariances(solution: Solution) -> CovarianceVerdict:
    """Return whether the residuals are what the covariances promise, within what chance allows.

    Tested are the mean of chi2 and, relative to it, its spread (pairs much worse or better than stated) and each target
    axis.
    """
    n, chi2, squares, *axes = solution.sums.tolist()
    freedom = solution.freedom
    if freedom <= 0.0 or chi2 == 0.0:  # made-up pairs without any noise say nothing of it
        return CovarianceVerdict.HOLDS
    allowed = TUNING.contradiction_sigmas * math.sqrt(2.0 / freedom)
    spread = n * squares / chi2**2  # 15 / 9 for chi-square (3)
    factor = chi2 / freedom
    if abs(spread - 15.0 / 9.0) > TUNING.contradiction_sigmas * TUNING.spread_sigma / math.sqrt(n):
        return CovarianceVerdict.WRONG
    if max(abs(3.0 * s / freedom / factor - 1.0) for s in axes) > math.sqrt(3.0) * allowed:
        return CovarianceVerdict.WRONG
    return CovarianceVerdict.HOLDS if abs(factor - 1.0) < allowed else CovarianceVerdict.SCALED


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
    """Return the solution with the covariances of greatest likelihood, starting from `solution`.

    The source's noise is allowed for at the end alone: in each round that would take twice the time, and twice as many
    clouds of 60 % wrong pairs would end without a motion.
    """
    given = solution.weights
    used = given > 0.0
    n = int(np.count_nonzero(used))
    small_sample = 3.0 * n / solution.freedom  # the motion has taken up to six degrees of freedom of the residuals
    T = solution.T
    base = np.zeros((len(arrays.q), 3, 3)) if len(arrays.Sp) == 0 else arrays.Sp.copy()
    if len(arrays.Sq):
        base += T[:3, :3] @ arrays.Sq @ T[:3, :3].T
    factor = max(float(np.median(solution.chi2[used])) / _MEDIAN, 1e-6)
    added = np.full(3, 0.1 * factor * float(np.einsum("nii->n", base[used]).mean()) / 3.0)
    nu = np.inf
    W = np.empty((len(arrays.q), 8))
    for round_ in range(TUNING.adaptation_rounds):
        # residuals r, u = inv(S) r and chi2 = r'u under the covariances so far
        S = factor * base + np.diag(added)
        precisions(NO_COVARIANCES, S, T, 0.0, W)
        r = arrays.p - arrays.q @ T[:3, :3].T - T[:3, 3]
        w0, w1, w2, w3, w4, w5 = W[:, :6].T
        x, y, z = r.T
        u = np.stack([w0 * x + w1 * y + w2 * z, w1 * x + w3 * y + w4 * z, w2 * x + w4 * y + w5 * z], axis=1)
        chi2 = np.einsum("ni,ni->n", u, r)
        # the motion by the recursion, with Lange's weights (nu + 3) / (nu + chi2)
        if round_ % 3 == 2:
            nu = _degrees_of_freedom(chi2[used])
        t = (nu + 3.0) / (nu + chi2) if nu < np.inf else np.ones(len(chi2))
        now = solve(Arrays(arrays.q, arrays.p, NO_COVARIANCES, S, arrays.weights), prior, T, given * t)
        if not now.determined:
            break
        T, solution = now.T, now
        # s and b by a step of scoring
        previous = np.append(added, factor)
        shares = _scoring(W[used][:, FULL].reshape(-1, 3, 3), base[used], u[used], t[used] * small_sample)
        factor, added = float(shares[0]), shares[1:]
        change = np.abs(np.append(added, factor) - previous).max()
        if round_ > 5 and change < 1e-3 * previous.max():
            break
    if len(arrays.Sq):
        again = solve(with_noise(arrays, factor, added), prior, T, solution.weights)
        solution = again if again.determined else solution
    return Adapted(solution, factor, added, nu)


def with_noise(arrays: Arrays, factor: float, added: Array) -> Arrays:
    """Return the pairs with `factor` times their covariances, and variances `added` (3, m^2) along the target axes."""
    Sp = factor * arrays.Sp if len(arrays.Sp) else np.zeros((len(arrays.q), 3, 3))
    return arrays._replace(Sq=factor * arrays.Sq, Sp=Sp + np.diag(added))


def _scoring(W: Array, V: Array, u: Array, t: Array) -> Array:
    """Return the shares (s, bx, by, bz) >= 0 after a step of Fisher scoring (Rao): `F share = form`.

    `F_ij = sum tr(W V_i W V_j)` is twice the information of the shares, `form_i = sum t u'V_i u`. `W` (n x 3 x 3) are
    the precisions now, `V` the given covariances (V_0; V_1..3 are the unit matrices of an axis), `u = W r`, `t` the
    pairs' weights.
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


def _degrees_of_freedom(chi2: Array) -> float:
    """Return the nu of greatest likelihood for squared residuals of a trivariate t, from a table; inf: Gaussian."""
    nu = _NU[:, None]
    log_t = gammaln((nu + 3.0) / 2.0) - gammaln(nu / 2.0) - 1.5 * np.log(nu / 2.0)
    likelihood = (log_t - (nu + 3.0) / 2.0 * np.log1p(chi2 / nu)).sum(axis=1)
    gaussian = -0.5 * float(chi2.sum())
    best = int(np.argmax(likelihood))
    return float(_NU[best]) if likelihood[best] > gaussian + _GAIN else math.inf
