"""How far off the pose may be after it was in doubt: the camera may have followed a moving body."""

from dataclasses import dataclass, field

import numpy as np

from odom.geometry import se3
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class Doubt:
    """The `seconds` in doubt so far, and the `integral` over them of the velocity's covariance (6 x 6, camera frame).

    A followed body keeps moving, so that errors of the velocity v add up: over a doubt of duration t, cov(t v) = t
    times the integral of cov(v). `is_open`: the doubt goes on. `resolved` counts how often the camera has found its
    place again; each time the doubt starts from zero.
    """

    seconds: float = 0.0
    integral: Array = field(default_factory=lambda: np.zeros((6, 6)))
    is_open: bool = False
    resolved: int = 0

    def after(self, T_earlier_current: Array, spread: Array | None, since_s: float) -> "Doubt":
        """Return the doubt `since_s` seconds later, the camera having moved by `T_earlier_current`.

        Meanwhile its velocity has the covariance `spread` (6 x 6), None without doubt.
        """
        integral = self._carried(T_earlier_current)
        if spread is None:
            return Doubt(self.seconds, integral, False, self.resolved)
        return Doubt(self.seconds + since_s, integral + since_s * spread, True, self.resolved)

    def known_again(self) -> "Doubt":
        """Return the doubt of a camera that has found its place again: none."""
        return Doubt(resolved=self.resolved + 1)

    def since(self, earlier: "Doubt", T_earlier_current: Array) -> Array:
        """Return what the doubt adds to the covariance (6 x 6, camera frame) of the motion since an earlier pose.

        Where the camera has found its place again since, each of the two poses has its own doubt.
        """
        before = earlier._carried(T_earlier_current)
        if self.resolved == earlier.resolved:
            return (self.seconds - earlier.seconds) * (self.integral - before)
        return earlier.seconds * before + self.seconds * self.integral

    def _carried(self, T_earlier_current: Array) -> Array:
        """Return the integral (6 x 6), given in the earlier camera's frame, in the current one's."""
        if self.seconds == 0.0:  # nothing was added up yet
            return self.integral
        A = se3.adjoint(se3.inverse(T_earlier_current))
        return np.asarray(A @ self.integral @ A.T)
