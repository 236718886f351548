"""How far the axis along which depth is measured is turned against the colour camera's: a degree or two.

Depth comes as z along the axis of the camera that measured it. Where that is turned by small angles against the colour
camera's, distances are too large on one side of the image and too small on the other: on a Kinect (TUM fr1) by 1.7 % at
the edges, several times the noise there. A landmark that moves through the image then seems to come nearer, which pulls
the camera's pose along. Landmarks that are seen at several places in the image show the tilt, and adjustments estimate
it. Sources: geometry of two axes; A. Teichman, S. Miller, S. Thrun, "Unsupervised intrinsic calibration of depth
sensors via SLAM", RSS 2013, where such fields exceed the noise of depth.

Where a walk hardly shows the tilt, a tilt fitted to noise would bend it. So the tilt is 0 until the data favour one by
far. Source: Bayes factors, R. Kass, A. Raftery, Journal of the American Statistical Association 90, 1995.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from odom.frontend.camera.tuning import TUNING
from odom.geometry.arrays import Array

TILTS = 2
"""Angles of a tilt (rad): inverse depth is measured too small by the share `angles[0] x/z + angles[1] y/z`."""
_UNSEEN = np.eye(TILTS) / TUNING.tilt_sigma**2
"""How well a tilt (2 x 2, 1/rad^2) is known before anything is seen."""
_HELD = np.eye(TILTS) * 1e12
"""The same for a tilt that adjustments must not change."""


@dataclass(frozen=True, eq=False)
class DepthTilt:
    """What the stream has shown of the tilt: its `angles` (2, rad), and their `information` (2 x 2, 1/rad^2).

    Until `is_shown`, the angles are 0, and `evidence` (2, 1/rad) is the information times the angles that the
    observations ask for.
    """

    angles: Array = field(default_factory=lambda: np.zeros(TILTS))
    information: Array = field(default_factory=lambda: _UNSEEN)
    evidence: Array = field(default_factory=lambda: np.zeros(TILTS))
    is_shown: bool = False

    @property
    def is_new(self) -> bool:
        """Whether a tilt is shown whose size no adjustment has estimated yet."""
        return self.is_shown and not self.angles.any()

    @property
    def adjusted_information(self) -> Array:
        """The prior information for an adjustment (2 x 2, 1/rad^2)."""
        return self.information if self.is_shown else _HELD

    def with_change(self, change: Array, information: Array) -> "DepthTilt":
        """Return a tilt that is shown after an adjustment has moved it by `change` (2, rad).

        `information` (2 x 2, 1/rad^2) is what the adjustment adds.
        """
        return replace(self, angles=self.angles + change, information=self.information + information)

    def with_evidence(self, pull: Array, information: Array, share: float) -> "DepthTilt":
        """Return a tilt that is not shown after one more adjustment; it may be now.

        The observations would change it by the inverse of their `information` (2 x 2, 1/rad^2) times their `pull` (2,
        1/rad). Adjustments have most frames in common, so only a `share` of each counts.
        """
        evidence, known = self.evidence + share * pull, self.information + share * information
        is_shown_at_once = _log_odds(pull, _UNSEEN + information) > np.log(TUNING.tilt_odds_at_once)
        if is_shown_at_once or _log_odds(evidence, known) > np.log(TUNING.tilt_odds):
            return DepthTilt(is_shown=True)
        return replace(self, information=known, evidence=evidence)


def _log_odds(evidence: Array, information: Array) -> float:
    """Return the logarithm of the Bayes factor: half of the chi-squared a tilt explains, less its penalty."""
    explained = evidence @ np.linalg.solve(information, evidence)
    freedom = np.linalg.slogdet(information)[1] - np.linalg.slogdet(_UNSEEN)[1]
    return float(0.5 * (explained - freedom))


def without_tilt(values: Array, angles: Array) -> Array:
    """Return `values` (n x 3: x/z, y/z, 1/z; NaN without depth) as measured without a tilt by `angles` (2, rad)."""
    if not angles.any():
        return values
    straight = values.copy()
    straight[:, 2] *= 1.0 + values[:, :2] @ angles
    return straight


def by_tilt(values: Array) -> Array:
    """Return the derivative (n x 3 x 2) of `without_tilt` by the angles, 0 without depth."""
    derivative = np.zeros((len(values), 3, TILTS))
    derivative[:, 2] = np.nan_to_num(values[:, 2:]) * values[:, :2]
    return derivative
