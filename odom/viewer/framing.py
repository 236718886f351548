"""Where the eye of the map stands, and how large the camera is drawn: near and small at a desk, both not in a hall."""

from dataclasses import dataclass

import numpy as np

from odom.geometry.arrays import Array

_BEHIND = np.array([0.0, -0.8, -0.6])
"""Direction from what is looked at to the eye (x right, y down, z forward of the first camera): behind and above it."""
_BY_DEPTH, _BY_WAY = 1.0, 2.8
"""Distance of the eye, as a share of the median depth (a desk fills the view with less, is lost in it with more), and
of the radius of the way (with less it would leave the view)."""
_AHEAD = 0.2
"""The eye looks so far ahead of the way's middle, as a share of the median depth: at what the camera sees."""
_FRUSTUM = 0.06
"""Depth of the camera's pyramid over the eye's distance: larger hides the way, smaller the image in it."""
_OUTGROWN = 1.5
"""The eye steps back when it is too near by this factor: rarely, since each time takes the user's own view away."""


@dataclass(frozen=True, eq=False)
class Frame:
    """Position of the eye and what it looks at (3, m, in the map), and the depth of the camera's pyramid (m)."""

    eye: Array
    look_at: Array
    frustum_m: float


class Framing:
    """Chooses the frame by the first depth image, and anew when the way has outgrown it."""

    def __init__(self) -> None:
        self._distance_m = 0.0

    def fit(self, median_depth_m: float | None, way: Array) -> Frame | None:
        """Return the frame for a scene at this depth and a way (n x 3, m), None while the last one still fits."""
        if median_depth_m is None:
            return None
        low, high = (way.min(axis=0), way.max(axis=0)) if len(way) else (np.zeros(3), np.zeros(3))
        radius_m = 0.5 * float(np.linalg.norm(high - low))
        distance_m = max(_BY_DEPTH * median_depth_m, _BY_WAY * radius_m)
        if self._distance_m and _BY_WAY * radius_m < _OUTGROWN * self._distance_m:
            return None
        self._distance_m = distance_m
        look_at = 0.5 * (low + high) + np.array([0.0, 0.0, _AHEAD * median_depth_m])
        return Frame(look_at + distance_m * _BEHIND, look_at, _FRUSTUM * distance_m)
