"""When a frame becomes a key frame: too little is left of what the last one saw, and the camera has moved at all."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.registration import se3

Array = NDArray[np.float64]

_MANY, _SHARE_LEFT, _VERY_FEW = 150, 0.85, 50
_SHARE_COVERED, _COVER_PX = 0.55, 40
_MOVED_M, _MOVED_RAD = 0.015, 0.02


@dataclass(frozen=True)
class Coverage:
    """What a frame sees: `landmarks` found again, and the `cells` (40 x 40 px) of the image that they lie in."""

    landmarks: int
    cells: int

    @classmethod
    def of(cls, uv: Array) -> "Coverage":
        """Return the coverage of landmarks found at `uv` (n x 2, px)."""
        return cls(len(uv), len(np.unique(uv // _COVER_PX @ np.array([1.0, 1000.0]))))

    def is_worn(self, at_keyframe: "Coverage") -> bool:
        """Say whether too little is left of what was seen right after the last key frame."""
        few = self.landmarks < min(_MANY, _SHARE_LEFT * at_keyframe.landmarks)
        return few or self.landmarks < _VERY_FEW or self.cells < _SHARE_COVERED * at_keyframe.cells


def has_moved(T_camera_keyframe: Array) -> bool:
    """Say whether a camera is far enough from a key frame for another: at rest, none is added."""
    away = se3.log(T_camera_keyframe)
    return bool(np.linalg.norm(away[:3]) > _MOVED_M or np.linalg.norm(away[3:]) > _MOVED_RAD)
