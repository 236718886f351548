"""Rows carried to the time of the middle one by the motion that the whole trajectory shows.

A frame is measured before the next one is seen, by a motion that is late or smoothed where the camera speeds up or
turns. So the rows of a rolling shutter end up some hundredths of a pixel off, in the same way in all frames of a steady
walk: the focal length would come out .2 % too short, and the image's centre some pixels too high. This is for the
camera's parameters, which average over a walk, and for frames by whose rows a wrong readout was believed; for single
poses that shake, what their own rows showed is better.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from odom.backend.map.frame_log import FrameLog, LoggedFrame
from odom.backend.map.keyframe import FrameObservations, Keyframe
from odom.backend.map.map import Map
from odom.backend.mapping.tuning import TUNING
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.measurement import Measurements
from odom.geometry import se3
from odom.geometry.arrays import Array

_LONGEST_DELAY_S = 0.1
"""More than passes between an image's middle row and its stamp."""


def twists_at(numbers: Sequence[int], log: FrameLog, keyframes: Sequence[Keyframe], timing: ShutterTiming) -> Array:
    """Return the camera's velocity (K x 6, m/s and rad/s, its own frame) in K frames of the `log`, by their `numbers`.

    It is the slope of a straight line through the poses of the frames within `motion_window_s` to both sides; NaN where
    one side has no pose of the same segment.
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
        near = [(since_s, T) for since_s, T in apart if abs(since_s) < TUNING.motion_window_s]
        since = np.array([since_s for since_s, _ in near])
        if since.min() < 0.0 < since.max():
            T_camera_map = se3.inverse(here.T_map_camera)
            moved = np.array([se3.log(T_camera_map @ T_map_other) for _, T_map_other in near])
            twists[row] = np.polynomial.polynomial.polyfit(since, moved, 1)[1]
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


def _around(number: int, log: FrameLog) -> Iterator[int]:
    """Yield the numbers of frames stamped near frame `number`, itself included, and up to the first that is not."""
    middle, near_ns = log[number].stamp, 1e9 * (TUNING.motion_window_s + _LONGEST_DELAY_S)
    for numbers in (range(number, log.dropped - 1, -1), range(number + 1, log.count)):
        for other in numbers:
            if abs(log[other].stamp - middle) > near_ns:
                break
            yield other


def rays_as_seen(seen: Measurements, readout_s: float) -> Array:
    """Return the rays (N x 2, x/z and y/z) of measurements at the times of their own rows."""
    return seen.values[:, :2] - seen.jacobian_timing[:, :2, 0] * readout_s


def carried_anew(seen: Measurements, row: Array, inverse_depth: Array, twist: Array, readout_s: float) -> Measurements:
    """Return measurements whose rays are carried to the middle row's time by the camera's velocity `twist` (N x 6).

    Each lies in the `row` (N, from the middle one, as a share of the image's height) at an `inverse_depth` (N, 1/m);
    the image was read within `readout_s`. Those of which any of that is NaN stay as they were.
    """
    jacobian, values, rays = seen.jacobian_timing.copy(), seen.values.copy(), rays_as_seen(seen, readout_s)
    by_readout = -flow(rays, inverse_depth, twist) * row[:, None]
    is_known = np.isfinite(by_readout).all(axis=1)
    jacobian[is_known, :2, 0] = by_readout[is_known]
    values[is_known, :2] = (rays + by_readout * readout_s)[is_known]
    return replace(seen, values=values, jacobian_timing=jacobian)


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
    carried to another readout. `numbers` (K) and `poses` (K x 4 x 4, T_camera_map) are those of the frames.
    """
    known, L = sensor.timing.readout_s, map_.landmarks
    misjudged = [k for k, f in enumerate(frames) if abs(f.timing.readout_s - known) > TUNING.misjudged_readout_s]
    twists = twists_at([numbers[k] for k in misjudged], log, map_.keyframes, sensor.timing)
    for k, twist in zip(misjudged, twists, strict=True):
        frame, seen = frames[k], frames[k].measurements
        rays = rays_as_seen(seen, frame.timing.readout_s)
        v = sensor.lens.project(np.column_stack([rays, np.ones(len(rays))]), np.eye(4))[:, 1]
        row = v / sensor.lens.rays.shape[0] - 0.5
        depth_m = se3.apply(poses[k], L.position[frame.rows])[:, 2]
        depth_m = np.where(frame.current(L) & (depth_m > 0.0), depth_m, np.nan)
        twist = np.tile(twist, (len(rays), 1))
        frame.measurements = carried_anew(seen, row, 1.0 / depth_m, twist, frame.timing.readout_s)


def flow(rays: Array, inverse_depth: Array, twist: Array) -> Array:
    """Return the rates (N x 2, 1/s) of resting points' `rays` (N x 2, x/z and y/z) for a camera's velocity `twist`.

    As `point_flow` does of one.
    """
    (x, y), w = rays.T, inverse_depth
    tx, ty, tz, rx, ry, rz = twist.T
    turn = x * ry - y * rx
    return np.column_stack([w * (x * tz - tx) - ry - x * turn + y * rz, w * (y * tz - ty) + rx - y * turn - x * rz])
