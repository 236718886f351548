"""Errors of a trajectory against truth: absolute, relative, and whether the claimed covariance is honest.

ATE and RPE: J. Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", IROS 2012.
NEES: Y. Bar-Shalom et al., "Estimation with Applications to Tracking and Navigation", 2001, sec. 5.4.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.errors import InputError
from odom.evaluation.times import Stamps
from odom.evaluation.trajectory import nearest
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.geometry.rotations import angles_of

_LONGEST_STEP_PERIODS = 1.5
"""Longest step of a frame: a lost frame makes it two periods long, jitter adds less than half of one."""
NEES_BOUND_95 = 12.591587243743977
"""95 % quantile of the chi-squared distribution with six degrees of freedom."""


@dataclass(frozen=True)
class RelativeError:
    """RMSE of relative poses: metres and degrees, over `pairs` pairs."""

    rmse_m: float
    rmse_deg: float
    pairs: int


@dataclass(frozen=True, eq=False)
class Nees:
    """Normalised estimation error squared of each relative pose; 6 on average when the covariance is honest."""

    values: Array

    @property
    def mean(self) -> float:
        """Mean value; 6 is ideal, more is over-confident."""
        return float(self.values.mean()) if len(self.values) else float("nan")

    @property
    def inside_95(self) -> float:
        """Share of values below the 95 % bound of the chi-squared distribution with six degrees of freedom."""
        return float((self.values < NEES_BOUND_95).mean()) if len(self.values) else float("nan")


def rmse(errors: Array) -> float:
    """Return the root of the mean square; NaN for none."""
    return float(np.sqrt(np.mean(np.square(errors)))) if len(errors) else float("nan")


def pairs_of_neighbours(stamps: Stamps) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the index pairs (i, i + 1) at most 1.5 median periods apart, so that no step spans a hole."""
    steps = np.diff(stamps)
    index = np.flatnonzero(steps <= _LONGEST_STEP_PERIODS * np.median(steps)) if len(steps) else np.zeros(0, np.intp)
    return index, index + 1


def pairs_apart(stamps: Stamps, seconds: float, tolerance_s: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the index pairs (i, j) with stamp j the nearest to stamp i + `seconds`, within `tolerance_s`."""
    if len(stamps) < 2:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    goal = stamps + np.int64(round(seconds * 1e9))
    later = nearest(stamps, goal)
    good = (np.abs(stamps[later] - goal) <= tolerance_s * 1e9) & (later > np.arange(len(stamps)))
    return np.flatnonzero(good), later[good]


def relative_error(
    T_world_estimate: Array, T_world_truth: Array, earlier: NDArray[np.intp], later: NDArray[np.intp]
) -> RelativeError:
    """Return the RMSE of `inverse(Q_i^-1 Q_j) (P_i^-1 P_j)` over index pairs (i, j), P estimated, Q true.

    This is eq. (1) of Sturm et al.
    """
    P = se3.inverses(T_world_estimate[earlier]) @ T_world_estimate[later]
    Q = se3.inverses(T_world_truth[earlier]) @ T_world_truth[later]
    E = se3.inverses(Q) @ P
    metres, radians = np.linalg.norm(E[:, :3, 3], axis=1), angles_of(E[:, :3, :3])
    return RelativeError(rmse(metres), float(np.degrees(rmse(radians))), len(metres))


def tangent_errors(T_estimate: Array, T_truth: Array) -> Array:
    """Return the errors `log(inv(T_estimate) T_truth)` (n x 6: rho, phi) of n poses."""
    return se3.logs(se3.inverses(T_estimate) @ T_truth)


def nees(errors: Array, covariances: Array) -> Nees:
    """Return the NEES `e' inv(S) e` of n tangent errors (n x 6) with their covariances (n x 6 x 6).

    Raises InputError when a covariance is not positive definite.
    """
    if not len(errors):
        return Nees(np.zeros(0))
    try:
        roots = np.linalg.cholesky(covariances)
    except np.linalg.LinAlgError:
        raise InputError("a 6 x 6 covariance is not positive definite: no NEES can be computed from it") from None
    whitened = np.linalg.solve(roots, errors[:, :, None])[:, :, 0]
    return Nees(np.square(whitened).sum(axis=1))
