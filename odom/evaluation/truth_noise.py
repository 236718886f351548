"""The noise of the truth itself, estimated from its samples, and what it adds to a relative pose's covariance."""

from dataclasses import dataclass

import numpy as np

from odom.evaluation.relative import RelativePoses
from odom.evaluation.trajectory import Trajectory
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.geometry.normal_distribution import NORMAL_MAD
from odom.geometry.rotations import vectors_of

_LONGEST_PERIOD_S = 0.0125
"""At less than 80 Hz a hand's own jerk hides the noise in third differences."""
_LEAST_POSES = 100
"""With fewer the median is rough: 100 give the standard deviation to 12 %."""
_THIRD_DIFFERENCE_GAIN = np.sqrt(20.0)
"""Standard deviation of the third difference (1, -3, 3, -1) of white noise of unit variance."""
_INTERPOLATED = 2.0 / 3.0
"""Mean variance of a value interpolated half-way at random between two samples of unit variance."""


@dataclass(frozen=True)
class TruthNoise:
    """Standard deviation of the truth's white noise along each axis: metres and radians."""

    sigma_m: float
    sigma_rad: float

    @property
    def interpolated_covariance(self) -> Array:
        """The 6 x 6 covariance of truth that was interpolated between two samples."""
        return _INTERPOLATED * np.diag([self.sigma_m**2] * 3 + [self.sigma_rad**2] * 3)


def truth_noise(truth: Trajectory) -> TruthNoise | None:
    """Return the white noise of densely sampled truth, or None where motion and noise cannot be told apart.

    Third differences of a hand's motion over samples 10 ms apart are some .05 mm; of white noise they are sqrt(20)
    times its sigma. The median absolute deviation is used, so spikes do not count. Noise that the capture system
    has already smoothed is underestimated: it is a floor. Truth sampled at less than 80 Hz gives None.
    """
    if len(truth) < _LEAST_POSES or np.median(np.diff(truth.stamps)) > _LONGEST_PERIOD_S * 1e9:
        return None
    turns = vectors_of((se3.inverses(truth.T_world_body[:-1]) @ truth.T_world_body[1:])[:, :3, :3])
    third = (np.diff(truth.positions, n=3, axis=0), np.diff(turns, n=2, axis=0))
    metres, radians = (float(NORMAL_MAD * np.median(np.abs(d)) / _THIRD_DIFFERENCE_GAIN) for d in third)
    return TruthNoise(metres, radians)


def widened(poses: RelativePoses, noise: TruthNoise | None) -> RelativePoses:
    """Return the relative poses with the truth's noise, where known, at both stamps added to their covariances."""
    if noise is None:
        return poses
    at_one = noise.interpolated_covariance
    A = se3.adjoints(se3.inverses(poses.T_earlier_current))
    added = A @ at_one @ A.transpose(0, 2, 1) + at_one  # as `se3.compose_covariance`
    return RelativePoses(poses.stamps_earlier, poses.stamps_current, poses.T_earlier_current, poses.covariances + added)
