"""Is the noise what we think it is? The stream's own residuals answer, and the covariance follows them.

Three answers, each a slow average: the pixel's sigma, the inverse depth's sigma at several distances, and by how much
poses from different parts of the image disagree more than their covariances allow (errors that neighbours share, such
as the lens's or the depth's calibration, do not average out and show only there).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odom.frontend.measure import FeatureNoise

Array = NDArray[np.float64]

_MEDIAN_CHI2_1, _MEDIAN_CHI2_2 = 0.4549, 1.3863
_GAIN = 0.05
_LEAST = 15
_RANGE = 4.0


@dataclass(frozen=True, eq=False)
class SelfCheck:
    """`noise` as it now seems, what it was at the start, and `inflation` of pose covariances (at least 1)."""

    noise: FeatureNoise
    start: FeatureNoise
    inflation: float = 1.0

    @classmethod
    def of(cls, noise: FeatureNoise) -> "SelfCheck":
        """Return the check that starts from `noise`."""
        return cls(noise, noise)

    def with_residuals(self, chi2: Array, inverse_depth: Array) -> "SelfCheck":
        """Return the check after one more frame's inliers: chi2 (n x 2: ray, depth; depth 0 where not measured)."""
        if len(chi2) < _LEAST:
            return self
        pixel = self.noise.pixel_sigma * (float(np.median(chi2[:, 0])) / _MEDIAN_CHI2_2) ** (_GAIN / 2)
        pixel = min(max(pixel, self.start.pixel_sigma / _RANGE), self.start.pixel_sigma * _RANGE)
        knots, sigma = self.noise.inverse_depth_sigma
        sigma = sigma.copy()
        nearest = np.abs(inverse_depth[:, None] - knots[None, :]).argmin(axis=1)
        measured = chi2[:, 1] > 0.0
        for k in range(len(knots)):
            there = measured & (nearest == k)
            if np.count_nonzero(there) >= _LEAST:
                sigma[k] *= (np.median(chi2[there, 1]) / _MEDIAN_CHI2_1) ** (_GAIN / 2)
        first = self.start.inverse_depth_sigma[1]
        table = np.stack([knots, np.clip(sigma, first / _RANGE, first * _RANGE)])
        return replace(self, noise=replace(self.noise, pixel_sigma=pixel, inverse_depth_sigma=table))

    def with_disagreement(self, nees: float) -> "SelfCheck":
        """Return the check after comparing poses of two parts of one image: their difference's NEES (6 expected)."""
        seen = min(max(nees / 6.0, 0.1), 50.0)
        return replace(self, inflation=self.inflation * (1.0 - _GAIN) + _GAIN * seen)

    @property
    def scale(self) -> float:
        """What to multiply a pose covariance with."""
        return max(1.0, self.inflation)
