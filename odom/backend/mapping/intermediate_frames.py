"""Frames between key frames: what some of them measured is kept for the final adjustment.

A key frame is made where the view has changed; in between, dozens of frames see the same landmarks from other poses.
Adjusting five a second of them with the key frames at the end takes a tenth to a third off the trajectory's error; the
others are moved with them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from odom.backend.map.frame_log import FrameLog, LoggedFrame
from odom.backend.map.keyframe import FrameObservations, Keyframe
from odom.backend.map.landmarks import Landmarks
from odom.backend.mapping.tuning import TUNING
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.features.lens_change import LensChange
from odom.geometry import se3
from odom.geometry.arrays import Array


@dataclass(eq=False, kw_only=True)
class IntermediateFrame(FrameObservations):
    """What frame `number` (counted from the first) measured; its pose is `T_camera_keyframe` in `keyframe`."""

    number: int
    keyframe: int
    T_camera_keyframe: Array

    def pose(self, keyframes: list[Keyframe]) -> Array:
        """Return T_camera_map, as its key frame among all `keyframes` lies now."""
        return np.asarray(self.T_camera_keyframe @ keyframes[self.keyframe].T_camera_map)


class IntermediateFrames:
    """Five tracked frames a second; beyond 240 (7 MB) every other one is dropped, and half as many are kept later."""

    def __init__(self, every_s: float = TUNING.intermediate_s, most: int = TUNING.intermediate_most) -> None:
        self.kept: list[IntermediateFrame] = []
        self._every_s, self._most = every_s, most

    def wants(self, number: int, period_s: float) -> bool:
        """Return whether frame `number` is one of those to be kept, of a stream whose frames are `period_s` apart.

        Where the period is not known yet (0), only the first one is.
        """
        every = max(1, round(self._every_s / period_s)) if period_s else np.inf
        return number % every == 0

    def add(
        self, number: int, tracked: TrackedFrame, keyframes: list[Keyframe], landmarks: Landmarks, timing: ShutterTiming
    ) -> None:
        """Keep what the tracked frame `number` measured, once."""
        if self.kept and self.kept[-1].number == number:
            return
        seen = FrameObservations.of(tracked.inlier_landmarks, landmarks, timing)
        self.kept.append(
            IntermediateFrame(
                rows=seen.rows,
                identities=seen.identities,
                measurements=seen.measurements,
                timing=timing,
                displaced=FrameObservations.of(tracked.displaced, landmarks, timing),
                number=number,
                keyframe=tracked.reference,
                T_camera_keyframe=tracked.T_camera_map @ se3.inverse(keyframes[tracked.reference].T_camera_map),
            )
        )
        if len(self.kept) > self._most:
            self._every_s *= 2.0
            self.kept = self.kept[::2]

    def change_lens(self, change: LensChange) -> None:
        """Convert what was measured to a new lens."""
        for frame in self.kept:
            frame.change_lens(change)

    def move(self, adjusted: Mapping[int, Array], keyframes: list[Keyframe]) -> None:
        """Set the poses of frames to T_camera_map as `adjusted`, by their numbers, relative to the `keyframes`."""
        for frame in self.kept:
            if frame.number in adjusted:
                T_map_keyframe = se3.inverse(keyframes[frame.keyframe].T_camera_map)
                frame.T_camera_keyframe = adjusted[frame.number] @ T_map_keyframe

    def among(self, members: list[Keyframe]) -> list[IntermediateFrame]:
        """Return the frames placed by the key frames `members`, thinned to as many as may be adjusted with them.

        The newest one is among them wherever there is room.
        """
        numbers = {k.number for k in members}
        mine = [s for s in self.kept if s.keyframe in numbers]
        room = TUNING.adjusted_most - len(members)
        return mine[:: -max(1, -(-len(mine) // room))][::-1] if room > 0 else []


def corrected(frames: FrameLog, keyframes: list[Keyframe], adjusted: Mapping[int, Array]) -> Iterator[LoggedFrame]:
    """Yield `frames` corrected by those that were adjusted, of which `adjusted` holds T_camera_map by number.

    The frames that became `keyframes` were adjusted, too. Between adjusted frames the correction relative to the same
    key frame is interpolated; at that key frame it is zero.
    """
    became = {keyframe.frame: keyframe for keyframe in keyframes if keyframe.frame >= 0}
    knots: dict[int, list[tuple[int, Array]]] = {}
    for number, frame in enumerate(frames, frames.dropped):
        own = became.get(number)
        if own is not None:
            knots.setdefault(own.number, []).append((number, np.zeros(6)))
        if frame.keyframe is None or frame.T_keyframe_camera is None:
            continue
        reference, T_camera_map = keyframes[frame.keyframe], adjusted.get(number)
        if own is not None and own.segment == reference.segment:
            T_camera_map = own.T_camera_map
        if T_camera_map is not None:
            T_map_camera = se3.inverse(reference.T_camera_map) @ frame.T_keyframe_camera
            knots.setdefault(reference.number, []).append((number, -se3.log(T_camera_map @ T_map_camera)))
    lines = {
        keyframe: (np.array([at for at, _ in mine]), np.array([moved for _, moved in mine]).T)
        for keyframe, mine in knots.items()
    }
    for number, frame in enumerate(frames, frames.dropped):
        if frame.keyframe not in lines or frame.T_keyframe_camera is None:
            yield frame
            continue
        at, moved = lines[frame.keyframe]
        step = np.array([np.interp(number, at, along) for along in moved])
        yield replace(frame, T_keyframe_camera=frame.T_keyframe_camera @ se3.exp(step))
