"""The viewpoint of the map, and the size of the drawn camera: close and small at a desk, far and large in a hall."""

from dataclasses import dataclass

import numpy as np

from odom.geometry.arrays import Array

_BEHIND = np.array([0.0, -0.8, -0.6])
"""Direction from what is looked at to the eye (x right, y down, z forward of the first camera): behind and above it."""
_BY_DEPTH, _BY_EXTENT = 1.0, 2.8
"""Distance of the eye, as a share of the median depth (a desk fills the view with less, is lost in it with more), and
of the radius of the trajectory (with less it would leave the view)."""
_AHEAD = 0.2
"""The eye looks so far ahead of the trajectory's middle, as a share of the median depth: at what the camera sees."""
_FRUSTUM = 0.06
"""Depth of the camera's pyramid over the eye's distance: larger hides the trajectory, smaller the image in it."""
_LEAST_BY_EXTENT = 2.3
"""The eye steps back when it is nearer than so many times what the trajectory leads away from where it looks."""
_ROOM_TO_GROW = 1.8
"""The eye steps back by so much more than is needed: rarely, since each time takes the user's own view away."""


@dataclass(frozen=True, eq=False)
class Frame:
    """Position of the eye and what it looks at (3, m, in the map), and the depth of the camera's pyramid (m)."""

    eye: Array
    look_at: Array
    frustum_m: float


class Framing:
    """Chooses the frame by the first depth image, and anew when the trajectory leaves it."""

    def __init__(self) -> None:
        self._distance_m = 0.0
        self._middle = np.zeros(3)

    def fit(self, median_depth_m: float | None, positions: Array) -> Frame | None:
        """Return the frame for a scene at this depth and positions (n x 3, m), None while the last one still fits."""
        if median_depth_m is None:
            return None
        if self._distance_m and _LEAST_BY_EXTENT * _reach(positions, self._middle) <= self._distance_m:
            return None
        room = _ROOM_TO_GROW if self._distance_m else 1.0
        self._middle = 0.5 * (positions.min(axis=0) + positions.max(axis=0)) if len(positions) else np.zeros(3)
        self._distance_m = max(_BY_DEPTH * median_depth_m, room * _BY_EXTENT * _reach(positions, self._middle))
        look_at = self._middle + np.array([0.0, 0.0, _AHEAD * median_depth_m])
        return Frame(look_at + self._distance_m * _BEHIND, look_at, _FRUSTUM * self._distance_m)


def _reach(positions: Array, middle: Array) -> float:
    """Return how far positions (n x 3, m) lead away from a middle."""
    return float(np.linalg.norm(positions - middle, axis=1).max(initial=0.0))
