"""What is adjusted together: the newest key frames while the camera moves, and everything at the end."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from odom.backend.map.keyframe import FrameObservations, Keyframe
from odom.backend.map.lens_conversion import positions_through
from odom.backend.map.map import Map
from odom.backend.mapping.bundle_adjustment import Bundle, adjust
from odom.backend.mapping.intermediate_frames import IntermediateFrame, IntermediateFrames
from odom.backend.mapping.observations import Observations, gather_observations
from odom.backend.mapping.tuning import TUNING
from odom.frontend.camera.depth_tilt import TILTS, by_tilt, without_tilt
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.lens_change import LensChange
from odom.geometry import se3
from odom.geometry.arrays import Array, Index, Mask


@dataclass(frozen=True, eq=False)
class Adjustment:
    """A snapshot of what is to be adjusted; `run` needs nothing else, so that it can work in the background.

    The key frames `numbers` come first, then the intermediate frames, by their numbers `between`. Those that share too
    few landmarks to be adjusted, `is_carried`, are held and move with others afterwards. The bundle's timing holds the
    shutter's (3) and the tilt of depth (2); `sensor_information` (5 x 5) is the prior on both.
    """

    numbers: Index
    between: Index
    is_fixed: Mask
    is_carried: Mask
    rows: Index
    identities: Index
    bundle: Bundle
    observations: Observations
    sensor_information: Array
    iterations: int

    def run(self) -> Bundle:
        """Return the adjusted bundle."""
        return adjust(self.bundle, self.is_fixed, self.observations, self.sensor_information, self.iterations)

    def started_at(self, timing_change: Array) -> "Adjustment":
        """Return the same adjustment that starts with another change of the bundle's timing (5)."""
        return replace(self, bundle=replace(self.bundle, timing_change=timing_change))

    def poses_between(self, bundle: Bundle) -> dict[int, Array]:
        """Return T_camera_map of the intermediate frames in an adjusted `bundle`, by their numbers, if not carried."""
        is_adjusted = ~self.is_carried[len(self.numbers) :]
        T_camera_map = bundle.T_camera_map[len(self.numbers) :][is_adjusted]
        return dict(zip(self.between[is_adjusted].tolist(), T_camera_map, strict=True))


def _snapshot(
    map_: Map,
    fixed: list[Keyframe],
    free: list[Keyframe],
    between: list[IntermediateFrame],
    sensor: SensorModel,
    credit: float,
    iterations: int,
    change: LensChange | None = None,
) -> Adjustment:
    keyframes = fixed + free
    seen: list[FrameObservations] = [*keyframes, *between]
    if change is not None:
        seen = [replace(frame, measurements=change.measured(frame.measurements)) for frame in seen]
    T_camera_map = np.array([k.T_camera_map for k in keyframes] + [s.pose(map_.keyframes) for s in between])
    observations, rows = gather_observations(seen, T_camera_map, map_.landmarks, sensor, TUNING.adjust_shared)
    straight = without_tilt(observations.values, sensor.depth_tilt.angles)
    jacobian = np.concatenate([observations.jacobian_timing, by_tilt(observations.values)], axis=2)
    observations = replace(observations, values=straight, jacobian_timing=jacobian)
    nothing = np.zeros(len(sensor.timing.vector) + TILTS)
    is_fixed = np.zeros(len(T_camera_map), dtype=np.bool_)
    is_fixed[: max(1, len(fixed))] = True
    is_seen = np.bincount(observations.keyframe, minlength=len(is_fixed)) > 0
    return Adjustment(
        numbers=np.array([k.number for k in keyframes]),
        between=np.array([s.number for s in between], dtype=np.int64),
        is_fixed=is_fixed,
        is_carried=~is_seen & ~is_fixed,
        rows=rows,
        identities=map_.landmarks.identity[rows].copy(),
        bundle=Bundle(T_camera_map, map_.landmarks.position[rows].copy(), nothing),
        observations=observations,
        sensor_information=sensor.adjusted_information / credit,
        iterations=iterations,
    )


def _oldest_connected(observations: Observations, frames: int) -> Index:
    """Return, for each of K frames, the first of those that common landmarks connect it with, itself included."""
    oldest = np.arange(frames)
    while True:
        of_landmark = np.full(int(observations.landmark.max(initial=-1)) + 1, frames)
        np.minimum.at(of_landmark, observations.landmark, oldest[observations.keyframe])
        reached = oldest.copy()
        np.minimum.at(reached, observations.keyframe, of_landmark[observations.landmark])
        if np.array_equal(reached, oldest):
            return oldest
        oldest = reached


def _with_parts_held(adjustment: Adjustment) -> Adjustment:
    """Return the adjustment with the oldest frame held of each part that common landmarks connect."""
    frames = len(adjustment.is_fixed)
    is_oldest = _oldest_connected(adjustment.observations, frames) == np.arange(frames)
    return replace(adjustment, is_fixed=adjustment.is_fixed | is_oldest)


def window_of(map_: Map, window: int) -> list[Keyframe]:
    """Return those of the `window` newest key frames that are of this run, and of the segment of the newest one."""
    mine = [map_.keyframes[n] for n in map_.remembered[-window:] if n >= map_.earlier_keyframes]
    return [k for k in mine if k.segment == mine[-1].segment]


def newest(map_: Map, window: int, sensor: SensorModel, credit: float) -> Adjustment:
    """Return the adjustment of the `window` newest key frames, held by older ones that measured the same landmarks.

    `credit` is the share of the observations' information that counts for timing and tilt, here and below.
    """
    free = window_of(map_, window)
    measured = np.concatenate([k.identities for k in free])
    linked = set().union(*(map_.links[k.number] for k in free)) - {k.number for k in free}
    shared = [
        (int(np.isin(map_.keyframes[k].identities, measured).sum()), k)
        for k in sorted(linked)[-TUNING.adjust_look_back :]
    ]
    best = sorted(((n, k) for n, k in shared if n >= TUNING.adjust_shared), reverse=True)[: TUNING.adjust_fixed]
    fixed = [map_.keyframes[k] for _, k in sorted(best, key=lambda pair: pair[1])]
    return _with_parts_held(_snapshot(map_, fixed, free, [], sensor, credit, TUNING.adjust_iterations))


def everything(
    map_: Map,
    intermediate: IntermediateFrames,
    segment: int,
    sensor: SensorModel,
    credit: float,
    change: LensChange | None = None,
) -> Adjustment:
    """Return the adjustment of all remembered key frames of a segment, and of intermediate frames.

    The oldest key frame is held; where forgotten key frames had connected the others, or nothing but surfaces had led
    from one to the next, the oldest of each part is.
    So are those of earlier sessions, and those next to key frames that are away: the map must not tear there. With a
    `change` of lens, what frames measured is converted to the new one; the landmarks are not.
    """
    keyframes = map_.members(segment)
    between = intermediate.among(keyframes)
    iterations = TUNING.finish_iterations
    whole = _snapshot(map_, keyframes[:1], keyframes[1:], between, sensor, credit, iterations, change)
    is_held = np.zeros(len(whole.is_fixed), dtype=np.bool_)
    is_held[: len(keyframes)] = [
        k.number < map_.earlier_keyframes or bool(map_.links[k.number] & map_.away) for k in keyframes
    ]
    whole = replace(whole, is_fixed=whole.is_fixed | is_held, is_carried=whole.is_carried & ~is_held)
    return _with_parts_held(whole)


def everything_through(
    change: LensChange,
    map_: Map,
    intermediate: IntermediateFrames,
    segment: int,
    sensor: SensorModel,
    credit: float,
) -> Adjustment:
    """Return the adjustment of a segment as a whole to what its frames would have measured through another lens."""
    whole = everything(map_, intermediate, segment, sensor, credit, change)
    landmarks = positions_through(map_, change, whole.rows)[0]
    return replace(whole, bundle=replace(whole.bundle, landmarks=landmarks))


def take_over(map_: Map, adjustment: Adjustment, result: Bundle) -> None:
    """Write an adjustment's result into the map, except for landmarks that were culled meanwhile."""
    L = map_.landmarks
    valid = L.identity[adjustment.rows] == adjustment.identities
    rows = adjustment.rows[valid]
    L.position[rows] = result.landmarks[valid]
    if result.covariances is not None:
        L.covariance[rows] = result.covariances[valid]
    keyframes = len(adjustment.numbers)
    free = np.flatnonzero(~adjustment.is_fixed[:keyframes])
    carried = adjustment.numbers[adjustment.is_carried[:keyframes]]
    adjusted = dict(zip(adjustment.numbers[free].tolist(), result.T_camera_map[free], strict=True))
    moved = adjusted | _carried(map_, carried.tolist(), adjusted)
    map_.move_keyframes(np.array([*moved], dtype=np.int64), np.array([*moved.values()]).reshape(-1, 4, 4), rows)
    map_.registrations.adjust(moved, map_.keyframes)


def _carried(map_: Map, carried: Collection[int], adjusted: Mapping[int, Array]) -> dict[int, Array]:
    """Return T_camera_map of key frames that are `carried`: each moves with the one whose place it is surest of.

    By the two or three landmarks that a key frame may share, it would move anywhere.
    """
    kept, moved = set(map_.remembered).difference(carried), {}
    for number in carried:
        anchor = map_.registrations.surest_of(number, kept)
        if anchor is not None and anchor in adjusted:
            T_keyframe_anchor = map_.keyframes[number].T_camera_map @ se3.inverse(map_.keyframes[anchor].T_camera_map)
            moved[number] = T_keyframe_anchor @ adjusted[anchor]
    return moved
