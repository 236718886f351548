"""Is the noise what we think it is? The stream's own residuals answer, and the covariance follows them.

Four answers, each a slow average: the pixel's sigma, the inverse depth's sigma at several distances, and by how much
more than their covariances allow poses from the left and the right half of the image disagree, and poses jump from
frame to frame. Errors that neighbours share, such as the lens's or the depth's calibration, do not average out and show
only in the two latter: the halves do not see what both share, a camera that is shaken jumps indeed, so the mean counts.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odom.frontend.measure import FeatureNoise

Array = NDArray[np.float64]

_MEDIAN_CHI2_1, _MEDIAN_CHI2_2 = 0.4549, 1.3863
_MEAN_TO_GEOMETRIC_CHI2_6 = 1.1922
_GAIN = 0.05
_LEAST = 15
_RANGE = 8.0
_CALIBRATION_ERROR = 0.025
_UNPROVEN = 5.0
"""The inflation of a sensor that has shown nothing of itself yet."""
_EXPLAINED_BY_NOISE = 3.0
_THIRD_DIFFERENCE_VARIANCE = 20.0
"""Of 1, -3, 3, -1 times independent errors of variance 1."""


@dataclass(frozen=True, eq=False)
class SelfCheck:
    """`noise` as it now seems, what it was at the start, and `inflation` of pose covariances after `comparisons`.

    `checks` counts the frames whose residuals were looked at; `jumps` is the inflation that `jumps_seen` successions of
    poses ask for, the last of which are `steps`.
    """

    noise: FeatureNoise
    start: FeatureNoise
    inflation: float = _UNPROVEN
    comparisons: int = 0
    checks: int = 0
    jumps: float = _UNPROVEN
    jumps_seen: int = 0
    steps: tuple[Array, ...] = ()

    @classmethod
    def of(cls, noise: FeatureNoise) -> "SelfCheck":
        """Return the check that starts from `noise`."""
        return cls(noise, noise)

    def with_residuals(self, chi2: Array, inverse_depth: Array) -> "SelfCheck":
        """Return the check after one more frame's inliers: chi2 (n x 2: ray, depth; depth 0 where not measured)."""
        if len(chi2) < _LEAST:
            return self
        gain = max(_GAIN, 1.0 / (self.checks + 2.0))
        pixel = self.noise.pixel_sigma * (float(np.median(chi2[:, 0])) / _MEDIAN_CHI2_2) ** (gain / 2)
        pixel = min(max(pixel, self.start.pixel_sigma / _RANGE), self.start.pixel_sigma * _RANGE)
        knots, sigma = self.noise.inverse_depth_sigma
        sigma = sigma.copy()
        nearest = np.abs(inverse_depth[:, None] - knots[None, :]).argmin(axis=1)
        measured = chi2[:, 1] > 0.0
        for k in range(len(knots)):
            there = measured & (nearest == k)
            if np.count_nonzero(there) >= _LEAST:
                sigma[k] *= (np.median(chi2[there, 1]) / _MEDIAN_CHI2_1) ** (gain / 2)
        first = self.start.inverse_depth_sigma[1]
        table = np.stack([knots, np.clip(sigma, first / _RANGE, first * _RANGE)])
        noise = replace(self.noise, pixel_sigma=pixel, inverse_depth_sigma=table)
        return replace(self, noise=noise, checks=self.checks + 1)

    def with_disagreement(self, nees: float) -> "SelfCheck":
        """Return the check after comparing poses of two parts of one image: their difference's NEES (6 expected)."""
        seen = min(max(nees / 6.0, 0.1), 50.0)
        gain = max(_GAIN, 1.0 / (self.comparisons + 2.0))
        inflation = self.inflation + gain * (seen - self.inflation)
        return replace(self, inflation=inflation, comparisons=self.comparisons + 1)

    def with_step(self, step: Array | None, information: Array) -> "SelfCheck":
        """Return the check after one more step (6, `se3`) to a pose of this 6 x 6 `information`, None where irregular.

        The third difference of four poses in a row, equally long apart, is noise but for the jerk of a hand; the mean
        over such is geometric, so that a jerk does not count like noise.
        """
        if step is None:
            return replace(self, steps=())
        steps = (*self.steps[-2:], step)
        if len(steps) < 3:
            return replace(self, steps=steps)
        third = steps[2] - 2.0 * steps[1] + steps[0]
        nees = float(third @ information @ third) / _THIRD_DIFFERENCE_VARIANCE
        seen = min(max(nees / 6.0, 0.1), 100.0) * _MEAN_TO_GEOMETRIC_CHI2_6
        gain = max(_GAIN, 1.0 / (self.jumps_seen + 2.0))
        jumps = self.jumps ** (1.0 - gain) * seen**gain
        return replace(self, steps=steps, jumps=jumps, jumps_seen=self.jumps_seen + 1)

    @property
    def scale(self) -> float:
        """What to multiply a pose covariance with."""
        return max(1.0, 0.5 * (self.inflation + self.jumps))

    @property
    def calibration_error(self) -> float:
        """By what share of a motion it may be wrong: 2.5 % where the halves' disagreement is all the calibration's.

        A wrong focal length or lens errs with the motion, and tears the halves of the image apart.
        """
        return _CALIBRATION_ERROR * max(0.0, 1.0 - _EXPLAINED_BY_NOISE / max(self.inflation, 1e-9))
