"""The noise of the camera, learnt from the stream's residuals; it sets the covariance of every pose.

Four slow averages: the sigma of a feature's pixel, the sigma of inverse depth at several distances, and two inflations
of pose covariances. The first inflation compares the poses that the left and the right half of an image give; the
second looks at how much poses jump from frame to frame. Errors that neighbouring features share (lens, depth
calibration) do not average out and show only in these two. Neither is complete: the halves miss errors that both share,
and a shaken camera really jumps. So their mean is used.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from odom.frontend.camera.tuning import TUNING
from odom.geometry.arrays import Array

_MEDIAN_CHI2_1, _MEDIAN_CHI2_2 = 0.4549, 1.3863
"""Medians of the chi-squared distributions with one and two degrees of freedom."""
_MEAN_TO_GEOMETRIC_CHI2_6 = 1.1922
"""Mean of chi-squared with six degrees of freedom over its geometric mean."""
_THIRD_DIFFERENCE_VARIANCE = 20.0
"""Variance of the third difference (1, -3, 3, -1) of independent errors of variance 1."""
_SMALLEST_RATIO = 0.1
"""Least inflation that one frame may show; it only keeps the geometric mean above zero."""


@dataclass(frozen=True)
class FeatureNoise:
    """Standard deviations of a feature's measurement.

    `pixel_sigma` (px) is the localisation's; `inverse_depth_sigma` (2 x k) a table of inverse depth (1/m, ascending)
    and its sigma (1/m).
    """

    pixel_sigma: float
    inverse_depth_sigma: Array


@dataclass(frozen=True, eq=False)
class NoiseMonitor:
    """The `feature_noise` as it now seems, what was assumed at the `start`, and the inflations of pose covariances.

    Of these factors one comes from `halves_seen` comparisons of the image's halves, the other from `jumps_seen` jumps
    of the pose, of which `steps` holds the last motions (6, `se3`). `residuals_seen` counts frames.
    """

    feature_noise: FeatureNoise
    start: FeatureNoise
    inflation_by_halves: float = TUNING.noise_unproven
    halves_seen: int = 0
    residuals_seen: int = 0
    inflation_by_jumps: float = TUNING.noise_unproven
    jumps_seen: int = 0
    steps: tuple[Array, ...] = ()

    @classmethod
    def of(cls, noise: FeatureNoise) -> "NoiseMonitor":
        """Return the monitor that starts from `noise`."""
        return cls(noise, noise)

    def with_residuals(self, chi2: Array, inverse_depth: Array) -> "NoiseMonitor":
        """Return the monitor after one more frame's inliers.

        `chi2` (n x 2) holds the squared normalised residuals of ray and depth (0: not measured), `inverse_depth` (n,
        1/m) their distance. The median residual should be that of chi-squared; each sigma moves towards it.
        """
        if len(chi2) < TUNING.noise_least:
            return self
        gain = max(TUNING.noise_gain, 1.0 / (self.residuals_seen + 2.0))
        pixel = self.feature_noise.pixel_sigma * (float(np.median(chi2[:, 0])) / _MEDIAN_CHI2_2) ** (gain / 2)
        largest = TUNING.noise_range
        pixel = min(max(pixel, self.start.pixel_sigma / largest), self.start.pixel_sigma * largest)
        knots, sigma = self.feature_noise.inverse_depth_sigma
        sigma = sigma.copy()
        nearest = np.abs(inverse_depth[:, None] - knots[None, :]).argmin(axis=1)
        has_depth = chi2[:, 1] > 0.0
        for k in range(len(knots)):
            at_knot = has_depth & (nearest == k)
            if np.count_nonzero(at_knot) >= TUNING.noise_least:
                sigma[k] *= (np.median(chi2[at_knot, 1]) / _MEDIAN_CHI2_1) ** (gain / 2)
        first = self.start.inverse_depth_sigma[1]
        table = np.stack([knots, np.clip(sigma, first / largest, first * largest)])
        return replace(self, feature_noise=FeatureNoise(pixel, table), residuals_seen=self.residuals_seen + 1)

    def with_halves(self, nees: float) -> "NoiseMonitor":
        """Return the monitor after comparing the poses of the image's halves: their difference's NEES (6 expected)."""
        seen = min(max(nees / 6.0, _SMALLEST_RATIO), TUNING.noise_most)
        gain = max(TUNING.noise_gain, 1.0 / (self.halves_seen + 2.0))
        inflation = self.inflation_by_halves + gain * (seen - self.inflation_by_halves)
        return replace(self, inflation_by_halves=inflation, halves_seen=self.halves_seen + 1)

    def with_step(self, step: Array | None, information: Array) -> "NoiseMonitor":
        """Return the monitor after one more `step` (6, `se3`) to a pose of this 6 x 6 `information`.

        `step` is None where the frames are not equally far apart in time. The third difference of four poses in a row
        is noise, except for the jerk of a hand; its average is geometric, so that one jerk counts little.
        """
        if step is None:
            return replace(self, steps=())
        steps = (*self.steps[-2:], step)
        if len(steps) < 3:
            return replace(self, steps=steps)
        third = steps[2] - 2.0 * steps[1] + steps[0]
        nees = float(third @ information @ third) / _THIRD_DIFFERENCE_VARIANCE
        seen = min(max(nees / 6.0, _SMALLEST_RATIO), TUNING.noise_most_jump) * _MEAN_TO_GEOMETRIC_CHI2_6
        gain = max(TUNING.noise_gain, 1.0 / (self.jumps_seen + 2.0))
        inflation = self.inflation_by_jumps ** (1.0 - gain) * seen**gain
        return replace(self, steps=steps, inflation_by_jumps=inflation, jumps_seen=self.jumps_seen + 1)

    @property
    def covariance_scale(self) -> float:
        """The factor by which to multiply the covariance of a pose."""
        return max(1.0, 0.5 * (self.inflation_by_halves + self.inflation_by_jumps))

    @property
    def calibration_error(self) -> float:
        """The share of a motion by which it may be wrong because of the calibration.

        A wrong focal length or lens gives errors in proportion to the motion, and makes the halves of the image
        disagree: by the square of its error, as far as noise does not explain it.
        """
        unexplained = max(0.0, self.inflation_by_halves - TUNING.noise_explained)
        return TUNING.noise_calibration_error * math.sqrt(unexplained)
