"""Growing the map as the camera goes: when a frame becomes a key frame, measured anew once its motion is known."""

import numpy as np
from numpy.typing import NDArray

from odom.backend.background import Seen
from odom.backend.choice import Coverage, has_moved
from odom.backend.keyframes import Keyframe, Measured
from odom.backend.mapper import Mapper
from odom.backend.selfcheck import SelfCheck
from odom.backend.tracking import Tracked
from odom.frontend.view import View
from odom.registration import se3

Array = NDArray[np.float64]


class Growth:
    """Adds key frames to the map of `mapper`."""

    def __init__(self, mapper: Mapper) -> None:
        self._mapper = mapper
        self._newest: Seen | None = None
        self._covered: Coverage | None = None

    def begin(self, view: View, T_camera_map: Array, segment: int, check: SelfCheck) -> Keyframe:
        """Begin a segment with a frame at rest; whoever follows from it measures it anew."""
        still, none, sure = np.zeros(6), Measured.nothing(), np.zeros((6, 6))
        self._newest = self._covered = None
        return self._mapper.add_keyframe(view, T_camera_map, still, none, check, segment, None, sure)

    def look_again(self) -> None:
        """Take what the next frame sees for what the last key frame did: the camera is at another place."""
        self._covered = None

    def is_due(self, tracked: Tracked) -> bool:
        """Say whether too little is left in a frame of what the last key frame saw, and the camera has moved."""
        coverage = Coverage.of(tracked.inlying.uv)
        self._covered = self._covered or coverage
        near = self._mapper.map.keyframes[tracked.reference]
        return coverage.is_worn(self._covered) and has_moved(tracked.T_camera_map @ se3.inverse(near.T_camera_map))

    def add(
        self, view: View, tracked: Tracked, twist: Array, segment: int, covariance: Array, check: SelfCheck
    ) -> Keyframe:
        """Make a key frame of a tracked frame; the pose has that `covariance` (6 x 6), its motion `twist` (6, SI)."""
        keyframe = self._mapper.add_keyframe(
            view, tracked.T_camera_map, twist, tracked.inlying, check, segment, tracked.reference, covariance
        )
        self._newest, self._covered = Seen(keyframe.number, view, twist), None
        return keyframe

    def go_on(self, twist: Array | None, check: SelfCheck) -> None:
        """Measure the last frame anew if it is a key frame: with `twist` (6, SI) to the next one, its motion is known.

        Without (None: the next one did not follow from it) it stays as it is.
        """
        if self._newest is not None and twist is not None:
            middle = 0.5 * (self._newest.twist + twist)
            self._mapper.remeasure(self._newest.keyframe, self._newest.view, middle, check)
        self._newest = None
