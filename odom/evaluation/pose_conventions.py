"""Whether poses were written by another convention than they are read by: found by trying the other ones.

Files say nothing about it. Read by the right convention, the errors against another trajectory of the same camera
become many times smaller, which no other fault of a trajectory brings about.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from odom.errors import InputError
from odom.evaluation.report import Report
from odom.evaluation.trajectory import Trajectory
from odom.geometry.arrays import Array
from odom.geometry.rotations import matrices_of, quaternions_of
from odom.geometry.se3 import inverses

Judge = Callable[[Trajectory], Report]

_TIMES_SMALLER = 4.0
"""How many times smaller the error must be by the other convention: one that is wrong, too, is not so by chance."""


@dataclass(frozen=True)
class _Measure:
    """An error of a report, in words, and the `least` from which another convention may be its cause."""

    of: Callable[[Report], float]
    least: float
    words: str


_DRIFT = _Measure(lambda report: report.rpe_1s.rmse_deg, 2.0, "rotations drift {:.2f} deg over 1 s")
"""2 degrees (RMSE): an odometry that tracks has tenths of a degree, and with wrong rotations it is tens."""
_ATE = _Measure(lambda report: report.ate_m, 0.05, "ATE is {:.3f} m")
"""5 cm: an odometry that tracks a desk or a room has a tenth to half of that."""


@dataclass(frozen=True)
class _Convention:
    """Another way to write poses: `read` gives `T_world_camera` (n x 4 x 4) of what was taken for it."""

    name: str
    remedy: str
    read: Callable[[Array], Array]
    error: _Measure = _DRIFT

    def note(self, written: Trajectory, found: Report | None, judge: Judge, whose: str) -> tuple[str, ...]:
        """Return the hint that a trajectory is written so, nothing where its errors do not say it."""
        error = np.inf if found is None else self.error.of(found)
        if not error > self.error.least:
            return ()
        try:
            other = self.error.of(judge(replace(written, T_world_body=self.read(written.T_world_body))))
        except InputError:
            return ()
        if not other < min(error / _TIMES_SMALLER, self.error.least):
            return ()
        was = "nothing could be judged" if found is None else self.error.words.format(error)
        return (f"{whose} {self.name}: read so, {self.error.words.format(other)}, as it is, {was}; {self.remedy}",)


def _with_w_first(T: Array) -> Array:
    out = T.copy()
    out[:, :3, :3] = matrices_of(quaternions_of(T[:, :3, :3])[:, [1, 2, 3, 0]])
    return out


def _with_axes(right: tuple[int, ...], down: tuple[int, ...], forward: tuple[int, ...]) -> Callable[[Array], Array]:
    """Return how poses of a camera frame become those of the optical one, whose axes are these in that frame."""
    T_camera_optical = np.eye(4)
    T_camera_optical[:3, :3] = np.column_stack([right, down, forward])
    return lambda T: np.asarray(T @ T_camera_optical)


def _in_metres(T: Array) -> Array:
    out = T.copy()
    out[:, :3, 3] /= 1000.0
    return out


_MIRROR_Y = np.diag([1.0, -1.0, 1.0, 1.0])
"""Left-handed axes into right-handed ones, by turning y round."""
_OTHER_NUMBERS = (
    _Convention(
        "quaternions seem to be written w x y z", "write its columns as stamp x y z qx qy qz qw", _with_w_first
    ),
    _Convention("positions seem to be in millimetres", "write metres: divide x, y and z by 1000", _in_metres, _ATE),
)
_OTHER_FRAMES = (
    _Convention(
        "axes seem to be left-handed, as Unity's",
        "mirror y: change the signs of y, qx and qz",
        lambda T: np.asarray(_MIRROR_Y @ T @ _MIRROR_Y),
        _ATE,
    ),
    _Convention(
        "poses seem to be the world's in the camera (T_camera_world)",
        "write their inverses, the camera's in the world",
        inverses,
        _ATE,
    ),
    _Convention(
        "camera seems to have y up and z backwards, as in OpenGL and Blender",
        "write poses of the optical frame (x right, y down, z forward)",
        _with_axes((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    ),
    _Convention(
        "camera seems to have x forward and z up, as ROS's camera_link and base_link",
        "write poses of the optical frame (x right, y down, z forward)",
        _with_axes((0, -1, 0), (0, 0, -1), (1, 0, 0)),
    ),
)


def convention_notes(written: Trajectory, found: Report | None, judge: Judge) -> tuple[str, ...]:
    """Return the hint that truth is written by another convention than the estimate, which is right, else nothing.

    `found` is the report with truth as it was read, None where there could be none; `judge` makes one with another in
    its place, or raises InputError.
    """
    return _first_note((*_OTHER_NUMBERS, *_OTHER_FRAMES), written, found, judge, "truth's")


def notes_of_both(
    estimate: Trajectory, truth: Trajectory, found: Report, judge: Callable[[Trajectory, Trajectory], Report]
) -> tuple[str, ...]:
    """Return the hint that one of two trajectories is written by another convention than the other, else nothing.

    Where they differ by an inversion, a mirror, or half a turn of the camera, that does not show which is wrong.
    """

    def with_truth(other: Trajectory) -> Report:
        return judge(estimate, other)

    def with_estimate(other: Trajectory) -> Report:
        return judge(other, truth)

    return (
        _first_note(_OTHER_NUMBERS, truth, found, with_truth, "truth's")
        or _first_note(_OTHER_NUMBERS, estimate, found, with_estimate, "the estimate's")
        or _first_note(_OTHER_FRAMES, truth, found, with_truth, "truth's, or else the estimate's,")
        or _first_note(_OTHER_FRAMES, estimate, found, with_estimate, "the estimate's")
    )


def _first_note(
    tried: Sequence[_Convention], written: Trajectory, found: Report | None, judge: Judge, whose: str
) -> tuple[str, ...]:
    notes = (convention.note(written, found, judge, whose) for convention in tried)
    return next((note for note in notes if note), ())
