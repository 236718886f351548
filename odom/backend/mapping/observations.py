"""What key frames measured of the landmarks they share, gathered for an adjustment."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from odom.backend.map.keyframe import FrameObservations
from odom.backend.map.landmarks import Landmarks
from odom.backend.mapping.row_motion import carried_by_walk
from odom.backend.mapping.steady_slopes import steadied
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.measurement import Measurements
from odom.geometry.arrays import Array, Index, Mask


@dataclass(frozen=True, eq=False)
class Observations:
    """N measurements, sorted by landmark: numbers of frame and landmark (N), and their values (see `Measurements`).

    These are `values` (N x 3), their `jacobian_timing` (N x 3 x t) and `variances` (N x 4).
    """

    keyframe: Index
    landmark: Index
    values: Array
    jacobian_timing: Array
    variances: Array


def gather_observations(
    frames: Sequence[FrameObservations], T_camera_map: Array, landmarks: Landmarks, sensor: SensorModel, least: int
) -> tuple[Observations, Index]:
    """Return what `frames` measured of the landmarks that at least two of them share, and those landmarks' rows.

    Numbers of frames and landmarks in the result count from 0 in the order given and returned; the values are carried
    to the timing of `sensor`, rays by the motion of the walk where frames know it (see `row_motion`). `T_camera_map` (K
    x 4 x 4) are the frames' poses, roughly. Nothing is returned of frames that share fewer than `least` landmarks.
    Landmarks of vague depth keep about the one they have: rays alone, nearly parallel ones, would let them run away.
    """
    frame_numbers, frame_rows, measured = [], [], []
    for number, frame in enumerate(frames):
        valid = frame.current(landmarks)
        frame_numbers.append(np.full(int(valid.sum()), number))
        frame_rows.append(frame.rows[valid])
        measured.append(frame.measurements.take(valid))
    frame_number, rows = np.concatenate(frame_numbers), np.concatenate(frame_rows)
    shared = np.flatnonzero(_shared(frame_number, rows, least))
    kept, landmark = np.unique(rows[shared], return_inverse=True)
    by_landmark = np.argsort(landmark, kind="stable")
    keep, landmark = shared[by_landmark], landmark[by_landmark]
    frame_number = frame_number[keep]
    seen = Measurements(*(np.concatenate([getattr(m, f.name) for m in measured])[keep] for f in fields(Measurements)))
    half_readout, focal_px = np.array([f.timing.half_readout for f in frames]), sensor.lens.intrinsics[:2]
    T = T_camera_map[frame_number]
    twist = np.array([f.twist_around for f in frames])[frame_number]
    if not np.isnan(twist).all():
        depth_m = np.einsum("ni,ni->n", T[:, 2, :3], landmarks.position[kept[landmark]]) + T[:, 2, 3]
        readout_s = np.array([f.timing.readout_s for f in frames])[frame_number]
        seen = carried_by_walk(seen, depth_m, twist, readout_s, sensor.lens)
    seen = steadied(seen, T[:, :3, :3], landmark, half_readout[frame_number], focal_px)
    seen = seen.by_one_timing([f.timing for f in frames], frame_number, sensor.timing)
    vague = np.flatnonzero(landmarks.is_vague(kept))
    first = np.searchsorted(landmark, vague)
    _keep_depths(seen, first, landmarks.position[kept[vague]], T_camera_map[frame_number[first]])
    return Observations(frame_number, landmark, seen.values, seen.jacobian_timing, seen.covariance), kept


def _shared(frame: Index, landmark: Index, least: int) -> Mask:
    """Return which of N observations, of numbered frames and landmarks (N each), are of landmarks that others share.

    Frames that have fewer than `least` of them are left out, and so do not count for the others.
    """
    is_shared = np.ones(len(frame), dtype=np.bool_)
    while True:
        seen_by = np.bincount(landmark[is_shared], minlength=int(landmark.max(initial=-1)) + 1)
        is_still = is_shared & (seen_by[landmark] >= 2)
        is_still &= (np.bincount(frame[is_still], minlength=int(frame.max(initial=-1)) + 1) >= least)[frame]
        if np.array_equal(is_still, is_shared):
            return is_shared
        is_shared = is_still


def _keep_depths(seen: Measurements, first: Index, points: Array, T_camera_map: Array) -> None:
    """Fill in the inverse depth of v landmarks where each was `seen` first (v), with one sigma of as much.

    They are at `points` (v x 3, m, map frame) before cameras at `T_camera_map` (v x 4 x 4). What was measured stays.
    """
    depth_m = (T_camera_map[:, 2, :3] * points).sum(axis=1) + T_camera_map[:, 2, 3]
    lacks = np.isnan(seen.values[first, 2]) & (depth_m > 0.0)
    seen.values[first[lacks], 2] = 1.0 / depth_m[lacks]
    seen.covariance[first[lacks], 3] = 1.0 / depth_m[lacks] ** 2
