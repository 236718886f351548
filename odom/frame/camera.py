"""The pinhole camera with lens distortion that the colour image was taken with."""

from dataclasses import dataclass
from numbers import Real

import numpy as np

from odom.errors import ConfigError
from odom.frame.depth_model import EXACT_DEPTH, DepthModel
from odom.geometry.arrays import Array

_COEFFICIENTS = (0, 4, 5, 8, 12, 14)
"""How many distortion coefficients OpenCV's lens models have."""


@dataclass(frozen=True)
class Camera:
    """Intrinsics of the colour image, to which the depth image is registered.

    `fx, fy, cx, cy` in pixels, pixel centres at whole numbers; `distortion` holds the coefficients of OpenCV's
    and ROS's `plumb_bob` (k1, k2, p1, p2, k3) or `rational_polynomial` (8) model, empty for none. `depth` is how the
    depth image errs; by itself it does not.

    >>> Camera(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5).matrix
    array([[525. ,   0. , 319.5],
           [  0. , 525. , 239.5],
           [  0. ,   0. ,   1. ]])

    Raises ConfigError when a value is no number or not finite, a size or focal length not positive or a size no
    whole number.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    depth: DepthModel = EXACT_DEPTH

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "distortion", tuple(float(value) for value in np.ravel(self.distortion)))
        except (TypeError, ValueError):
            raise ConfigError(
                f"distortion of the camera is {self.distortion!r}: give its coefficients, () where there are none"
            ) from None
        for name in ("width", "height", "fx", "fy", "cx", "cy"):
            if not isinstance(value := getattr(self, name), Real):
                raise ConfigError(
                    f"{name} of the camera is {value!r} ({type(value).__name__}): give a number of pixels"
                )
        values = (self.width, self.height, self.fx, self.fy, self.cx, self.cy, *self.distortion)
        if self.fy < 0 < self.fx:
            raise ConfigError(
                f"fy is negative, {self.fy:g}: its y axis points up, and true poses by it are mirrored; give "
                f"{-self.fy:g} (true poses in ICL-NUIM's *.gt.freiburg are turned round when they are read)"
            )
        if not np.isfinite(values).all() or min(values[:4]) <= 0:
            raise ConfigError(f"camera {self} cannot be used: give finite intrinsics and a positive size")
        if self.width % 1 or self.height % 1:
            raise ConfigError(f"camera {self} cannot be used: width and height are whole numbers of pixels")
        object.__setattr__(self, "width", int(self.width))
        object.__setattr__(self, "height", int(self.height))
        if len(self.distortion) not in _COEFFICIENTS:
            raise ConfigError(f"{len(self.distortion)} distortion coefficients: give 0, 4, 5, 8, 12 or 14")

    @property
    def matrix(self) -> Array:
        """The 3 x 3 matrix K that maps camera coordinates to homogeneous pixels."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])
