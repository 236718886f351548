"""The pinhole camera with lens distortion that the colour image was taken with."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.errors import ConfigError


@dataclass(frozen=True)
class Camera:
    """Intrinsics of the colour image, to which the depth image is registered.

    `fx, fy, cx, cy` in pixels, pixel centres at whole numbers; `distortion` holds the coefficients of OpenCV's
    and ROS's `plumb_bob` (k1, k2, p1, p2, k3) or `rational_polynomial` (8) model, empty for none.
    Raises ConfigError when a value is not finite or a size or focal length is not positive.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        values = (self.fx, self.fy, self.cx, self.cy, *self.distortion)
        if not np.isfinite(values).all() or min(self.width, self.height, self.fx, self.fy) <= 0:
            raise ConfigError(f"camera {self} cannot be used: give finite intrinsics and a positive size")
        if len(self.distortion) not in (0, 4, 5, 8, 12, 14):
            raise ConfigError(f"{len(self.distortion)} distortion coefficients: give 0, 4, 5, 8, 12 or 14")

    @property
    def matrix(self) -> NDArray[np.float64]:
        """The 3 x 3 matrix K that maps camera coordinates to homogeneous pixels."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])
