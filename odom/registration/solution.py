"""The recursion's solution of checked pairs."""

from typing import NamedTuple

import numpy as np

from odom.geometry.arrays import Array
from odom.registration.checked_arrays import Arrays
from odom.registration.information_recursion import Output, recurse
from odom.registration.measurement_covariance import bad_covariance
from odom.registration.pairs import Prior
from odom.registration.weighted_projection import tangent_basis

_GATED_ROUNDS = 6
"""Bound of the rounds in which pairs may join or leave; 3 give the same motions."""
_LINEARISATIONS = 3
"""How often R of S_k is computed anew without a gate; 2 give the same motions to three digits."""
_NO_PRIOR = np.empty((0, 0)), np.eye(4)
"""Information of no rows, and the motion it would lie at."""


class Solution(NamedTuple):
    """What the recursion knows after all pairs: the motion T, its information H, Y and y of vec[R | t].

    `W`, `weights` and `chi2` belong to the pairs, `sums` (6) are those of `statistics`; `determined` is False where
    the pairs do not fix the motion. `by_prior` is how many of its 6 numbers the prior tells, not the pairs:
    6 - trace(inv(H) B'Y B), with B as in `tangent_basis`.
    """

    T: Array
    H: Array
    Y: Array
    y: Array
    W: Array
    weights: Array
    chi2: Array
    sums: Array
    determined: bool
    by_prior: float = 0.0

    @property
    def freedom(self) -> float:
        """The degrees of freedom of the sum of chi2: three per pair, less six for the motion; 0 if undetermined.

        A prior's share of the six is none of the pairs'.
        """
        free = 3.0 * float(self.sums[0]) - 6.0 + self.by_prior
        return free if self.determined and (self.sums[0] > 2.0 or self.by_prior > 0.0) else 0.0

    @property
    def variance_factor(self) -> float:
        """The mean of chi2 of the pairs used against its expectation; 1 where that is not known."""
        freedom = self.freedom
        return float(self.sums[1]) / freedom if freedom else 1.0


def solve(
    arrays: Arrays, prior: Prior | None, T: Array, weights: Array, bound: float = np.inf, alpha: float = 0.0
) -> Solution:
    """Return the recursion's solution, S_k linearised at `T` first; pairs within `bound` are chosen anew each round.

    `alpha` > 0 takes the norm-bounded form of the source's noise. Raises InputError for a covariance that is not
    positive definite.
    """
    n = len(arrays.q)
    motion, weights = T.copy(), weights.copy()
    found = Output(np.empty((n, 8)), np.empty((12, 12)), np.empty(12), np.empty((6, 6)), np.empty(n), np.empty(6))
    rounds = _GATED_ROUNDS if bound < np.inf else _LINEARISATIONS if len(arrays.Sq) > 0 else 1
    known = prior_information(prior)
    status = recurse(arrays, known, alpha, bound, rounds, motion, weights, found)
    if status > 0:
        raise bad_covariance(status - 1)
    W, Y, y, H, chi2, sums = found
    if status < 0:  # no motion was found
        chi2.fill(np.nan)
    by_prior = 0.0
    if status == 0 and len(known[0]) > 0:
        B = np.empty((12, 6))
        tangent_basis(motion, B)
        by_prior = 6.0 - float(np.trace(np.linalg.solve(H, B.T @ Y @ B)))
    return Solution(motion, H, Y, y, W, weights, chi2, sums, status == 0, by_prior)


def prior_information(prior: Prior | None) -> tuple[Array, Array]:
    """Return the prior's information (6 x 6; empty for none, or for a mere hint) and the motion it lies at."""
    if prior is None or prior.covariance is None:
        return _NO_PRIOR
    return np.asarray(np.linalg.inv(prior.covariance), dtype=np.float64), prior.T_target_source
