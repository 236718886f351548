"""Adjusting the newest key frames together, away from the frame's path, and everything at the end."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odom.backend.bundle import Bundle, Observations, adjust
from odom.backend.keyframes import Keyframe, gather_observations
from odom.backend.map import Map
from odom.backend.sightings import Sighting, Sightings
from odom.frontend.timing import Timing

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_MOST_FIXED = 10
_LEAST_SHARED = 15
_LOOK_BACK = 60
_WINDOW_ITERATIONS, _FINAL_ITERATIONS = 5, 15


@dataclass(frozen=True, eq=False)
class Adjustment:
    """A snapshot of what is to be adjusted; `run` works on it alone, so that it may do so in the background.

    The key frames `numbers` come first, then the frames of the sightings `between` them.
    """

    numbers: Index
    between: Index
    is_fixed: NDArray[np.bool_]
    rows: Index
    identities: Index
    bundle: Bundle
    observations: Observations
    timing_information: Array
    iterations: int

    def run(self) -> Bundle:
        """Return the adjusted bundle."""
        return adjust(self.bundle, self.is_fixed, self.observations, self.timing_information, self.iterations)


def _snapshot(
    map_: Map,
    fixed: list[Keyframe],
    free: list[Keyframe],
    between: list[Sighting],
    timing: Timing,
    information: Array,
    iterations: int,
) -> Adjustment:
    keyframes = fixed + free
    observations, rows = gather_observations([*keyframes, *between], map_.landmarks, timing)
    is_fixed = np.zeros(len(keyframes) + len(between), dtype=np.bool_)
    is_fixed[: max(1, len(fixed))] = True
    T_camera_map = [k.T_camera_map for k in keyframes]
    T_camera_map += [s.T_camera_keyframe @ map_.keyframes[s.keyframe].T_camera_map for s in between]
    return Adjustment(
        np.array([k.number for k in keyframes]),
        np.array([s.number for s in between], dtype=np.int64),
        is_fixed,
        rows,
        map_.landmarks.identity[rows].copy(),
        Bundle(np.array(T_camera_map), map_.landmarks.position[rows].copy(), np.zeros_like(timing.vector)),
        observations,
        information,
        iterations,
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


def newest(map_: Map, window: int, timing: Timing, timing_information: Array) -> Adjustment:
    """Return the adjustment of the `window` newest key frames, held by older ones that measured the same landmarks."""
    free = [map_.keyframes[n] for n in map_.remembered[-window:]]
    segment = free[-1].segment
    free = [k for k in free if k.segment == segment]
    measured = np.concatenate([k.identities for k in free])
    linked = set().union(*(map_.links[k.number] for k in free)) - {k.number for k in free}
    shared = [(int(np.isin(map_.keyframes[k].identities, measured).sum()), k) for k in sorted(linked)[-_LOOK_BACK:]]
    best = sorted(((n, k) for n, k in shared if n >= _LEAST_SHARED), reverse=True)[:_MOST_FIXED]
    fixed = [map_.keyframes[k] for _, k in sorted(best, key=lambda pair: pair[1])]
    return _snapshot(map_, fixed, free, [], timing, timing_information, _WINDOW_ITERATIONS)


def everything(map_: Map, sightings: Sightings, segment: int, timing: Timing, timing_information: Array) -> Adjustment:
    """Return the adjustment of all key frames of a segment that are remembered, the oldest one held, and of sightings.

    Where what joined them is forgotten, the oldest one of each part is.
    """
    keyframes = map_.members(segment)
    between = sightings.beside(keyframes)
    whole = _snapshot(map_, keyframes[:1], keyframes[1:], between, timing, timing_information, _FINAL_ITERATIONS)
    frames = len(whole.is_fixed)
    is_oldest = _oldest_connected(whole.observations, frames) == np.arange(frames)
    return replace(whole, is_fixed=whole.is_fixed | is_oldest)


def take_over(map_: Map, adjustment: Adjustment, result: Bundle) -> None:
    """Put an adjustment's result into the map, as far as it still holds what was adjusted."""
    L = map_.landmarks
    valid = L.identity[adjustment.rows] == adjustment.identities
    rows = adjustment.rows[valid]
    L.position[rows] = result.landmarks[valid]
    if result.covariances is not None:
        L.covariance[rows] = result.covariances[valid]
    free = np.flatnonzero(~adjustment.is_fixed[: len(adjustment.numbers)])
    map_.move_keyframes(adjustment.numbers[free], result.T_camera_map[free], rows)
    map_.registrations.adjust(adjustment.numbers[free].tolist(), map_.keyframes)
