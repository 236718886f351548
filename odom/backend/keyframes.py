"""Key frames: where they are, and which landmarks they measured."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from odom.backend.bundle import Observations
from odom.backend.landmarks import Landmarks
from odom.frame import Stamp
from odom.frontend.measure import Measurements
from odom.frontend.timing import Timing

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_NO_ROWS, _NO_UV = np.zeros(0, dtype=np.int64), np.zeros((0, 2))
_NOTHING_MEASURED = Measurements.nothing()


@dataclass(frozen=True, eq=False)
class Measured:
    """Landmarks, by their `rows` (n), that a frame has measured at `uv` (n x 2 px)."""

    rows: Index
    uv: Array
    measurements: Measurements

    @classmethod
    def nothing(cls) -> "Measured":
        """Return that of no landmark."""
        return cls(_NO_ROWS, _NO_UV, _NOTHING_MEASURED)


@dataclass(eq=False, kw_only=True)
class Observed:
    """What a frame measured of landmarks, which `rows` and `identities` (n) name, carried with `timing`."""

    rows: Index
    identities: Index
    measurements: Measurements
    timing: Timing

    def current(self, landmarks: Landmarks) -> NDArray[np.bool_]:
        """Return which of the measured landmarks are still in the map (n)."""
        return np.asarray(landmarks.identity[self.rows] == self.identities)


@dataclass(eq=False, kw_only=True)
class Keyframe(Observed):
    """A frame whose measurements are kept, at `uv` (n x 2 px); `T_camera_map` moves as the map is adjusted.

    The pose is its middle row's, `T_middle_stamp` leads on to its stamp. `first` is the key frame that its segment
    began with, `covariance_since_start` (6 x 6, `se3`, camera frame) that of the motion since.
    """

    number: int
    stamp: Stamp
    segment: int
    first: int
    T_camera_map: Array
    uv: Array
    covariance_since_start: Array
    T_middle_stamp: Array = field(default_factory=lambda: np.eye(4))

    def forget(self) -> None:
        """Drop what was measured; the arrays that are left are shared by all that have forgotten."""
        self.rows = self.identities = _NO_ROWS
        self.uv, self.measurements = _NO_UV, _NOTHING_MEASURED


def gather_observations(frames: Sequence[Observed], landmarks: Landmarks, timing: Timing) -> tuple[Observations, Index]:
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
    row = np.concatenate(rows)
    unique, index, count = np.unique(row, return_inverse=True, return_counts=True)
    useful = count >= 2
    number_of = np.cumsum(useful) - 1
    keep = np.flatnonzero(useful[index])
    keep = keep[np.argsort(number_of[index[keep]], kind="stable")]
    observations = Observations(
        np.concatenate(frame_numbers)[keep],
        number_of[index[keep]],
        np.concatenate(values)[keep],
        np.concatenate(jacobians)[keep],
        np.concatenate(variances)[keep],
    )
    return observations, unique[useful]
