"""Rows carried to the time of the middle one by the motion that the whole trajectory shows.

A frame is measured before the next one is seen, by a motion that is late or smoothed where the camera speeds up or
turns. So the rows of a rolling shutter end up some hundredths of a pixel off, in the same way in all frames of a steady
walk: the focal length would come out .2 % too short, and the image's centre some pixels too high. The velocity that a
frame's own rows show rests on the readout that was believed: carried by it, rows seem to confirm that readout. So this
is for the camera's parameters, which average over a walk, for the shutter's timing, and for frames by whose rows a
wrong readout was believed; for single poses that shake, what their own rows showed is better.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from odom.backend.map.frame_log import FrameLog, LoggedFrame
from odom.backend.map.keyframe import UNKNOWN_TWIST, FrameObservations, Keyframe
from odom.backend.map.map import Map
from odom.backend.mapping.tuning import TUNING
from odom.frontend.camera.lens import Lens
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.measurement import Measurements
from odom.geometry import se3
from odom.geometry.arrays import Array

_LONGEST_DELAY_S = 0.1
"""More than passes between an image's middle row and its stamp."""


def twists_at(numbers: Sequence[int], log: FrameLog, keyframes: Sequence[Keyframe], timing: ShutterTiming) -> Array:
    """Return the camera's velocity (K x 6, m/s and rad/s, its own frame) in K frames of the `log`, by their `numbers`.

    It is the slope of a straight line through the poses of the frames within `motion_window_s`, and of the next one to
    each side; NaN where one side has no pose of the same segment within `motion_reach_s`.
    """
    twists = np.full((len(numbers), 6), np.nan)
    known: dict[int, _Placed | None] = {}
    for row, number in enumerate(numbers):
        here = _placed(number, log, keyframes, known)
        if here is None:
            continue
        placed = [_placed(other, log, keyframes, known) for other in _around(number, log)]
        mine = [other for other in placed if other is not None and other.segment == here.segment]
        apart = [(other.frame.since_s(here.frame, timing), other.T_map_camera) for other in mine]
        since = np.array([since_s for since_s, _ in apart])
        before, after = since[since < 0.0], since[since > 0.0]
        to_next_s = max(-before.max(initial=-np.inf), after.min(initial=np.inf))
        if to_next_s < TUNING.motion_reach_s:
            T_camera_map = se3.inverse(here.T_map_camera)
            near = np.flatnonzero(np.abs(since) <= max(to_next_s, TUNING.motion_window_s))
            moved = np.array([se3.log(T_camera_map @ apart[k][1]) for k in near])
            twists[row] = np.polynomial.polynomial.polyfit(since[near], moved, 1)[1]
    return twists


class _Placed(NamedTuple):
    """A frame with its pose, and the segment that this is in."""

    frame: LoggedFrame
    T_map_camera: Array
    segment: int


def _placed(
    number: int, log: FrameLog, keyframes: Sequence[Keyframe], known: dict[int, _Placed | None]
) -> _Placed | None:
    """Return frame `number` with its pose, None where it has none or is gone; it is kept in `known`."""
    if number not in known:
        frame = log[number] if log.dropped <= number < log.count else None
        known[number] = None
        if frame is not None and frame.keyframe is not None and frame.T_keyframe_camera is not None:
            keyframe = keyframes[frame.keyframe]
            T_map_camera = se3.inverse(keyframe.T_camera_map) @ frame.T_keyframe_camera
            known[number] = _Placed(frame, T_map_camera, keyframe.segment)
    return known[number]


def _near_ns() -> float:
    return 1e9 * (TUNING.motion_reach_s + _LONGEST_DELAY_S)


def _around(number: int, log: FrameLog) -> Iterator[int]:
    """Yield the numbers of frames stamped near frame `number`, itself included, and up to the first that is not."""
    middle, near_ns = log[number].stamp, _near_ns()
    for numbers in (range(number, log.dropped - 1, -1), range(number + 1, log.count)):
        for other in numbers:
            if abs(log[other].stamp - middle) > near_ns:
                break
            yield other


def rays_as_seen(seen: Measurements, readout_s: float | Array) -> Array:
    """Return the rays (N x 2, x/z and y/z) of measurements at the times of their own rows."""
    return np.asarray(seen.values[:, :2] - seen.jacobian_timing[:, :2, 0] * np.reshape(readout_s, (-1, 1)))


def carried_anew(
    seen: Measurements, row: Array, inverse_depth: Array, twist: Array, readout_s: float | Array
) -> Measurements:
    """Return measurements whose rays are carried to the middle row's time by the camera's velocity `twist` (N x 6).

    Each lies in the `row` (N, from the middle one, as a share of the image's height) at an `inverse_depth` (N, 1/m);
    its image was read within `readout_s` (N, or that of all). Those of which any of that is NaN stay as they were.
    """
    rays = rays_as_seen(seen, readout_s)
    return _carried(seen, rays, row, flow(rays, inverse_depth, twist), readout_s)


def _carried(seen: Measurements, rays: Array, row: Array, rates: Array, readout_s: float | Array) -> Measurements:
    """Return measurements whose `rays`, as seen, are carried to the middle row's time by their `rates` (N x 3, 1/s)."""
    jacobian, values = seen.jacobian_timing.copy(), seen.values.copy()
    by_readout = -rates[:, :2] * row[:, None]
    is_known = np.isfinite(by_readout).all(axis=1)
    jacobian[is_known, :2, 0] = by_readout[is_known]
    values[is_known, :2] = (rays + by_readout * np.reshape(readout_s, (-1, 1)))[is_known]
    return replace(seen, values=values, jacobian_timing=jacobian)


def carried_by_walk(
    seen: Measurements, depth_m: Array, twist: Array, readout_s: float | Array, lens: Lens
) -> Measurements:
    """Return measurements (N) through a `lens`, carried anew by the camera's velocity `twist` (N x 6), see above.

    Their landmarks lie in a depth of `depth_m` (N, m; NaN where that is not known, or it is behind the camera). Their
    inverse depths stay, but not how these depend on the timing.
    """
    rays = rays_as_seen(seen, readout_s)
    row = lens.project(np.column_stack([rays, np.ones(len(rays))]), np.eye(4))[:, 1] / lens.rays.shape[0] - 0.5
    inverse_depth = 1.0 / np.where(depth_m > 0.0, depth_m, np.nan)
    rates = flow(rays, inverse_depth, twist)
    by_lag = (seen.slope * lens.intrinsics[:2] * rates[:, :2]).sum(axis=1) - rates[:, 2]
    half = np.where(np.asarray(readout_s) >= 0.0, 0.5, -0.5)
    of_depth = np.column_stack([(half - row) * by_lag - rates[:, 2] * row, by_lag, row * by_lag])
    is_known = np.isfinite(of_depth).all(axis=1) & np.isfinite(seen.values[:, 2])
    anew = _carried(seen, rays, row, rates, readout_s)
    anew.jacobian_timing[is_known, 2] = of_depth[is_known]
    return anew


def note_twists_around(
    frames: Sequence[Keyframe], log: FrameLog, keyframes: Sequence[Keyframe], timing: ShutterTiming
) -> None:
    """Note in `frames` the velocity that the frames around them show, as far as it is known and was not noted for good.

    Adjustments find the timing by it until `carry_misjudged`.
    """
    if log.last is None:
        return
    seen_since_ns = log.last.stamp - _near_ns()
    open_ = [k for k in frames if k.stamp > seen_since_ns or np.isnan(k.twist_around[0])]
    for frame, twist in zip(open_, twists_at([k.frame for k in open_], log, keyframes, timing), strict=True):
        frame.twist_around = twist


def carry_misjudged(
    frames: Sequence[FrameObservations],
    numbers: Sequence[int],
    poses: Array,
    map_: Map,
    log: FrameLog,
    sensor: SensorModel,
) -> None:
    """Carry anew what those of K `frames` measured whose readout was believed to be far from the one known by now.

    Until the readout is known, rows show a wrong velocity, by which a frame's measurements were carried, and would be
    carried to another readout. From now on the others are what their own rows showed. `numbers` (K) and `poses` (K x 4
    x 4, T_camera_map) are those of the frames.
    """
    known, L = sensor.timing.readout_s, map_.landmarks
    for frame in frames:
        frame.twist_around = UNKNOWN_TWIST
    misjudged = [k for k, f in enumerate(frames) if abs(f.timing.readout_s - known) > TUNING.misjudged_readout_s]
    twists = twists_at([numbers[k] for k in misjudged], log, map_.keyframes, sensor.timing)
    for k, twist in zip(misjudged, twists, strict=True):
        frame, seen = frames[k], frames[k].measurements
        depth_m = se3.apply(poses[k], L.position[frame.rows])[:, 2]
        depth_m = np.where(frame.current(L), depth_m, np.nan)
        twist = np.tile(twist, (len(seen), 1))
        frame.measurements = carried_by_walk(seen, depth_m, twist, frame.timing.readout_s, sensor.lens)


def flow(rays: Array, inverse_depth: Array, twist: Array) -> Array:
    """Return the rates (N x 3, 1/s) of resting points' (x/z, y/z, 1/z) for a camera's velocity `twist` (N x 6).

    The points are seen along `rays` (N x 2, x/z and y/z). As `point_flow` does of one.
    """
    (x, y), w = rays.T, inverse_depth
    tx, ty, tz, rx, ry, rz = twist.T
    turn = x * ry - y * rx
    rates = w * (x * tz - tx) - ry - x * turn + y * rz, w * (y * tz - ty) + rx - y * turn - x * rz, w * (w * tz - turn)
    return np.column_stack(rates)
