"""Whether a trajectory's quaternions were written w x y z, as many libraries order them, where x y z w is read.

Positions are right then, and so is ATE; rotations are not. It is found by trying: read in the other order, the errors
of rotation become many times smaller.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from odom.errors import InputError
from odom.evaluation.report import Report
from odom.evaluation.trajectory import Trajectory
from odom.geometry.rotations import matrices_of, quaternions_of

_LEAST_DEG = 2.0
"""Drift of rotation over a second (RMSE, degrees) from which the other order is tried: an odometry that tracks has
tenths of a degree, and with the wrong order it is tens."""
_TIMES_SMALLER = 4.0
"""How many times smaller the drift must be in the other order: an order that is wrong, too, is not so by chance."""


def order_notes(
    read: Trajectory, found: Report | None, judge: Callable[[Trajectory], Report], whose: str = "truth"
) -> tuple[str, ...]:
    """Return the hint that the quaternions of `read`, which is called `whose`, are in another order, else nothing.

    `found` is the report with the trajectory as it was read, None where there could be none; `judge` makes one with
    another in its place, or raises InputError.
    """
    drift_deg = np.inf if found is None else found.rpe_1s.rmse_deg
    if not drift_deg > _LEAST_DEG:
        return ()
    try:
        other_deg = judge(_reordered(read)).rpe_1s.rmse_deg
    except InputError:
        return ()
    if not other_deg < min(drift_deg / _TIMES_SMALLER, _LEAST_DEG):
        return ()
    was = "could not be judged" if found is None else f"drift {drift_deg:.1f} deg over 1 s"
    return (
        f"{whose}'s quaternions seem to be written w x y z: read so, rotations drift {other_deg:.2f} deg over 1 s, "
        f"read x y z w, as is expected, they {was}; write its columns as stamp x y z qx qy qz qw",
    )


def _reordered(read: Trajectory) -> Trajectory:
    """Return the trajectory whose quaternions' four numbers, read as x y z w, are w x y z."""
    T = read.T_world_body.copy()
    T[:, :3, :3] = matrices_of(quaternions_of(T[:, :3, :3])[:, [1, 2, 3, 0]])
    return replace(read, T_world_body=T)
