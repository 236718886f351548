"""What key frames measured of the landmarks they share, gathered for an adjustment."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from odom.backend.map.keyframe import Observed
from odom.backend.map.landmarks import Landmarks
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry.arrays import Array, Index


@dataclass(frozen=True, eq=False)
class Observations:
    """N measurements, sorted by landmark: numbers of frame and landmark, and their values (see `Measurements`)."""

    keyframe: Index
    landmark: Index
    values: Array
    jacobian_timing: Array
    variances: Array


def gather_observations(
    frames: Sequence[Observed], landmarks: Landmarks, timing: ShutterTiming
) -> tuple[Observations, Index]:
    """Return what `frames` measured of the landmarks that at least two of them share, and those landmarks' rows.

    Numbers of frames and landmarks in the result count from 0 in the order given and returned; the values are
    carried to `timing`.
    """
    frame_numbers, rows, values, jacobians, variances = [], [], [], [], []
    for number, frame in enumerate(frames):
        valid = frame.current(landmarks)
        frame_numbers.append(np.full(int(valid.sum()), number))
        rows.append(frame.rows[valid])
        m = frame.measurements.take(valid)
        values.append(m.retimed(timing.vector - frame.timing.vector))
        jacobians.append(m.jacobian_timing)
        variances.append(m.covariance)
    unique, index, count = np.unique(np.concatenate(rows), return_inverse=True, return_counts=True)
    is_shared = count >= 2
    number_of = np.cumsum(is_shared) - 1
    keep = np.flatnonzero(is_shared[index])
    keep = keep[np.argsort(number_of[index[keep]], kind="stable")]
    observations = Observations(
        np.concatenate(frame_numbers)[keep],
        number_of[index[keep]],
        np.concatenate(values)[keep],
        np.concatenate(jacobians)[keep],
        np.concatenate(variances)[keep],
    )
    return observations, unique[is_shared]
