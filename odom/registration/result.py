"""From a solution to a result: its covariance, or the reason why the pairs do not give a motion."""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from odom.geometry.arrays import Mask
from odom.registration.checked_arrays import Arrays
from odom.registration.conditioning import Geometry, assess
from odom.registration.pairs import Prior, Registration, Verdict, degenerate
from odom.registration.solution import Solution
from odom.registration.tuning import TUNING

_SINGULAR = Geometry(False, 0.0, 0.0, 0.0)
"""The geometry of pairs that do not determine the motion."""


class NoiseScale(NamedTuple):
    """The noise against the stated one: factor of the covariance, observed `Registration.variance_factor`, details."""

    inflation: float = 1.0
    variance_factor: float = 1.0
    details: Mapping[str, float] = MappingProxyType({})


def registration_of(arrays: Arrays, prior: Prior | None, solution: Solution, noise: NoiseScale) -> Registration:
    """Return the registration that a solution stands for; DEGENERATE where pairs and prior do not fix the motion."""
    n = len(arrays.q)
    inliers: Mask = solution.weights > 0.0
    used = int(solution.sums[0]) if solution.determined else int(np.count_nonzero(inliers))
    is_prior_evidence = prior is not None and prior.covariance is not None
    covariance, geometry = np.empty((6, 6)), _SINGULAR
    if solution.determined and (used >= 3 or is_prior_evidence):
        geometry = assess(arrays.q, solution.W, solution.weights, solution.H, covariance)
    reason = ""
    if used < 3 and not is_prior_evidence:
        reason = f"{used} pairs of {n} can be used: at least 3 are needed"
    elif not geometry.is_regular:
        reason = f"{used} pairs do not determine the motion"
    elif not is_prior_evidence:
        sigma = math.sqrt(noise.inflation * max(covariance[3, 3], covariance[4, 4], covariance[5, 5]))
        factor = min(noise.inflation, max(1.0, noise.variance_factor))
        if geometry.scatter < TUNING.min_scatter_sigmas**2 * factor or geometry.thickness < 1e-9:
            reason = f"{used} points lie on a line or in one place, within their noise"
        elif sigma > TUNING.max_rotation_sigma_rad:
            reason = f"the rotation is uncertain by {math.degrees(sigma):.0f} degrees"
    if reason:
        return degenerate(n, reason, solution.chi2, inliers)
    return Registration(
        solution.T,
        covariance if noise.inflation == 1.0 else noise.inflation * covariance,
        inliers,
        solution.chi2,
        geometry.conditioning,
        Verdict.OK,
        variance_factor=noise.variance_factor,
        details=dict(noise.details),
    )
