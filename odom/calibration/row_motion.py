"""Rows carried to the time of the middle one by the motion that the whole trajectory shows.

A frame is measured before the next one is seen, by a motion that is late or smoothed where the camera speeds up or
turns. So the rows of a rolling shutter end up some hundredths of a pixel off, in the same way in all frames of a steady
walk: the focal length would come out .2 % too short, and the image's centre some pixels too high. This is for the
camera's parameters, which average over a walk; for single poses that shake, what their own rows showed is better.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from odom.backend.map.frame_log import LoggedFrame
from odom.backend.map.keyframe import Keyframe
from odom.calibration.parameters import LENS, vector_of
from odom.calibration.projection import project
from odom.calibration.tuning import TUNING
from odom.frame import Camera, Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.features.measurement import Measurements
from odom.geometry import se3
from odom.geometry.arrays import Array

_LONGEST_DELAY_S = 0.1
"""More than passes between an image's middle row and its stamp."""


def twists_at(
    stamps: Sequence[Stamp], frames: Iterable[LoggedFrame], keyframes: Sequence[Keyframe], timing: ShutterTiming
) -> Array:
    """Return the camera's velocity (K x 6, m/s and rad/s, its own frame) in K of the `frames`, by their `stamps`.

    It is the slope of a straight line through the poses of the frames within `motion_window_s` to both sides; NaN where
    one side has no pose of the same segment.
    """
    twists = np.full((len(stamps), 6), np.nan)
    near = [
        (frame, T_keyframe_camera, keyframes[frame.keyframe])
        for frame in _near(stamps, frames)
        if frame.keyframe is not None and (T_keyframe_camera := frame.T_keyframe_camera) is not None
    ]
    if not near:
        return twists
    first, window = near[0][0], TUNING.motion_window_s
    seconds = np.array([frame.since_s(first, timing) for frame, _, _ in near])
    T_map_camera = [se3.inverse(keyframe.T_camera_map) @ T for _, T, keyframe in near]
    segment = np.array([keyframe.segment for _, _, keyframe in near])
    place = {frame.stamp: k for k, (frame, _, _) in enumerate(near)}
    for row, stamp in enumerate(stamps):
        if (k := place.get(stamp)) is None:
            continue
        around = np.flatnonzero((np.abs(seconds - seconds[k]) < window) & (segment == segment[k]))
        since = seconds[around] - seconds[k]
        if since.min() < 0.0 < since.max():
            T_camera_map = se3.inverse(T_map_camera[k])
            moved = np.array([se3.log(T_camera_map @ T_map_camera[other]) for other in around])
            twists[row] = np.polynomial.polynomial.polyfit(since, moved, 1)[1]
    return twists


def _near(stamps: Sequence[Stamp], frames: Iterable[LoggedFrame]) -> Iterator[LoggedFrame]:
    """Yield the `frames` that are near one of the `stamps`: hours of the others need not be held."""
    wanted = np.sort(np.array(stamps, dtype=np.int64))
    near_ns = 1e9 * (TUNING.motion_window_s + _LONGEST_DELAY_S)
    for frame in frames:
        at = int(np.searchsorted(wanted, frame.stamp))
        if (np.abs(wanted[max(at - 1, 0) : at + 1] - frame.stamp) < near_ns).any():
            yield frame


def carried_anew(
    seen: Measurements, camera: Camera, twist: Array, T_camera_map: Array, points: Array, readout_s: float
) -> Measurements:
    """Return measurements whose rays are carried to the middle row's time by the camera's velocity `twist` (N x 6).

    Each is of a point (N x 3, map frame) seen at `T_camera_map` (N x 4 x 4) by `camera`. Those whose velocity is NaN
    stay as they were.
    """
    is_known = np.isfinite(twist[:, 0])
    depth_m = np.einsum("ni,ni->n", T_camera_map[:, 2, :3], points) + T_camera_map[:, 2, 3]
    jacobian, values = seen.jacobian_timing.copy(), seen.values.copy()
    raw = values[:, :2] - jacobian[:, :2, 0] * readout_s
    row = project(raw, vector_of(camera)[LENS])[0][:, 1] / camera.height - 0.5
    by_readout = -flow(raw, 1.0 / depth_m, twist) * row[:, None]
    jacobian[is_known, :2, 0] = by_readout[is_known]
    values[is_known, :2] = (raw + by_readout * readout_s)[is_known]
    return replace(seen, values=values, jacobian_timing=jacobian)


def flow(rays: Array, inverse_depth: Array, twist: Array) -> Array:
    """Return the rates (N x 2, 1/s) of resting points' `rays` (N x 2, x/z and y/z) for a camera's velocity `twist`.

    As `point_flow` does of one.
    """
    (x, y), w = rays.T, inverse_depth
    tx, ty, tz, rx, ry, rz = twist.T
    turn = x * ry - y * rx
    return np.column_stack([w * (x * tz - tx) - ry - x * turn + y * rz, w * (y * tz - ty) + rx - y * turn - x * rz])
