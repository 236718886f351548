"""Frames between key frames: what some of them measured is kept for the final adjustment, which moves the others too.

A key frame is made where the view has changed; in between, dozens of frames see the same landmarks from other places.
One in six or fewer, adjusted with the key frames at the end, takes a tenth to a third off the trajectory's error.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odom.backend.keyframes import Keyframe, Observed
from odom.backend.landmarks import Landmarks
from odom.backend.placed import Placed, PlacedFrames
from odom.backend.tracking import Tracked
from odom.frontend.timing import Timing
from odom.registration import se3

Array = NDArray[np.float64]

_EVERY, _MOST = 6, 240
_MOST_ADJUSTED = 150
"""Frames in a final adjustment, key frames included, where there are not more of those alone: its memory grows with the
square of their number."""


@dataclass(eq=False, kw_only=True)
class Sighting(Observed):
    """What frame `number` (counted from the first) measured, placed by `keyframe` at `T_camera_keyframe`."""

    number: int
    keyframe: int
    T_camera_keyframe: Array


class Sightings:
    """Every sixth tracked frame's sighting; beyond 240 (7 MB) every second of them goes, and twice as few come."""

    def __init__(self, every: int = _EVERY, most: int = _MOST) -> None:
        self.kept: list[Sighting] = []
        self._every, self._most = every, most

    def wants(self, number: int) -> bool:
        """Say whether frame `number` is one of those to be kept."""
        return number % self._every == 0

    def add(
        self, number: int, tracked: Tracked, keyframes: list[Keyframe], landmarks: Landmarks, timing: Timing
    ) -> None:
        """Keep what the tracked frame `number` measured, once."""
        if self.kept and self.kept[-1].number == number:
            return
        rows = tracked.inlying.rows
        self.kept.append(
            Sighting(
                rows=rows,
                identities=landmarks.identity[rows].copy(),
                measurements=tracked.inlying.measurements,
                timing=timing,
                number=number,
                keyframe=tracked.reference,
                T_camera_keyframe=tracked.T_camera_map @ se3.inverse(keyframes[tracked.reference].T_camera_map),
            )
        )
        if len(self.kept) > self._most:
            self._every *= 2
            self.kept = [s for s in self.kept if self.wants(s.number)]

    def beside(self, members: list[Keyframe]) -> list[Sighting]:
        """Return the sightings placed by the key frames `members`, thinned to what may be adjusted with them.

        The newest one is among them wherever there is room.
        """
        numbers = {k.number for k in members}
        mine = [s for s in self.kept if s.keyframe in numbers]
        room = _MOST_ADJUSTED - len(members)
        return mine[:: -max(1, -(-len(mine) // room))][::-1] if room > 0 else []


def settled(frames: PlacedFrames, keyframes: list[Keyframe], adjusted: Mapping[int, Array]) -> Iterator[Placed]:
    """Yield `frames` placed as the sightings say, whose T_camera_map `adjusted` has by their numbers.

    Between sightings the correction against the same key frame is interpolated; it begins with none at that key frame.
    """
    knots: dict[int, list[tuple[int, Array]]] = {}
    for number, placed in enumerate(frames, frames.dropped):
        if placed.keyframe is None or placed.T_keyframe_camera is None:
            continue
        mine = knots.setdefault(placed.keyframe, [(number - 1, np.zeros(6))])
        if number in adjusted:
            T_map_camera = se3.inverse(keyframes[placed.keyframe].T_camera_map) @ placed.T_keyframe_camera
            mine.append((number, -se3.log(adjusted[number] @ T_map_camera)))
    lines = {
        keyframe: (np.array([at for at, _ in mine]), np.array([moved for _, moved in mine]).T)
        for keyframe, mine in knots.items()
        if len(mine) > 1
    }
    for number, placed in enumerate(frames, frames.dropped):
        if placed.keyframe not in lines or placed.T_keyframe_camera is None:
            yield placed
            continue
        at, moved = lines[placed.keyframe]
        step = np.array([np.interp(number, at, along) for along in moved])
        yield replace(placed, T_keyframe_camera=placed.T_keyframe_camera @ se3.exp(step))
