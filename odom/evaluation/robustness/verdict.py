"""The figures of one run over a spoilt recording; above all, how often the odometry is wrong without reporting it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from odom.backend import Estimate, State
from odom.errors import InputError
from odom.evaluation.metrics import nees
from odom.evaluation.relative import RelativePoses, relative_errors_of
from odom.evaluation.report import evaluate
from odom.evaluation.trajectory import Trajectory
from odom.evaluation.truth_noise import truth_noise, widened
from odom.frame import Stamp
from odom.geometry.arrays import Array, Mask

BOUND_999 = float(chdtri(6, 0.001))
"""99.9 % quantile of the chi-squared distribution with six degrees of freedom: 22.46."""
WRONG_M, WRONG_DEG = 0.05, 3.0
"""A motion over a second is wrong when it is off by more than one of these, and by more than it claims."""


@dataclass(frozen=True)
class Verdict:
    """What one run gave; a figure that cannot be computed is None, and `error` says why a run gave nothing at all.

    Shares are of all `frames` given to the odometry. `ate_m` is that of the longest segment, which has `ate_share` of
    them; `tracked` are TRACKING or RECOVERED, `lost` are LOST, `wrong` are TRACKING and wrong. Only `judged` frames can
    be found wrong: TRACKING, with truth and with a motion over a second. `nees` is the mean over one second (6 is
    honest), `recovery_s` the mean time from LOST to the next tracked frame. After `unrecovered` losses no frame was
    tracked any more: their time to the last frame counts.
    """

    frames: int = 0
    ate_m: float | None = None
    ate_share: float = 0.0
    tracked: float = 0.0
    lost: float = 0.0
    wrong: float = 0.0
    judged: int = 0
    nees: float | None = None
    recovery_s: float | None = None
    unrecovered: int = 0
    segments: int = 0
    error: str = ""


def verdict(
    estimates: Sequence[Estimate],
    trajectory: Trajectory,
    truth: Trajectory,
    light_returns: Callable[[Stamp], Stamp] = lambda stamp: stamp,
) -> Verdict:
    """Judge a run by its estimates, its final trajectory and the camera's truth (its optical frame, on its clock).

    NEES and the bound of a wrong motion allow for the truth's own noise where its samples show it. A frame that was
    LOST could be found again from `light_returns(stamp)` on. Raises InputError for a covariance that is none.
    """
    moved = [estimate for estimate in estimates if estimate.second is not None]
    seconds = RelativePoses.of((estimate.stamp, estimate.second) for estimate in moved if estimate.second is not None)
    errors, squares, valid = _judged(seconds, truth)
    is_tracking = np.array([estimate.state is State.TRACKING for estimate in moved], dtype=bool)[valid]
    times = recovery_times(estimates, light_returns)
    frames = len(estimates)
    share = 1.0 / max(1, frames)
    ate_m, matched = _ate(trajectory, truth)
    return Verdict(
        frames=frames,
        ate_m=ate_m,
        ate_share=share * matched,
        tracked=share * sum(estimate.state.is_trusted for estimate in estimates),
        lost=share * sum(estimate.state is State.LOST for estimate in estimates),
        wrong=share * int((is_tracking & is_wrong(errors, squares)).sum()),
        judged=int(is_tracking.sum()),
        nees=float(squares.mean()) if len(squares) else None,
        recovery_s=float(np.mean([seconds for seconds, _ in times])) if times else None,
        unrecovered=sum(not found for _, found in times),
        segments=trajectory.segment_count,
    )


def is_wrong(errors: Array, squares: Array) -> Mask:
    """Return which motions are wrong: beyond 5 cm or 3 deg (of n x 6 tangent errors), and beyond their own bound.

    `squares` (n) are the errors' NEES: the bound is that of 99.9 % of honest ones.
    """
    metres, radians = np.linalg.norm(errors[:, :3], axis=1), np.linalg.norm(errors[:, 3:], axis=1)
    return np.asarray((squares > BOUND_999) & ((metres > WRONG_M) | (radians > np.radians(WRONG_DEG))))


def recovery_times(estimates: Sequence[Estimate], light_returns: Callable[[Stamp], Stamp]) -> list[tuple[float, bool]]:
    """Return the seconds of each loss from the first LOST frame to the next tracked one, and whether there was one.

    A loss in a black-out counts from the return of the light, and no frame in the dark ends it, whatever its state;
    without a tracked frame it lasts to the last frame.
    """
    times, since = [], None
    for estimate in estimates:
        if since is None and estimate.state is State.LOST:
            since = light_returns(estimate.stamp)
        elif since is not None and estimate.state.is_trusted and light_returns(estimate.stamp) == estimate.stamp:
            times.append((max(0.0, (estimate.stamp - since) * 1e-9), True))
            since = None
    if since is not None and estimates[-1].stamp > since:
        times.append(((estimates[-1].stamp - since) * 1e-9, False))
    return times


def _judged(seconds: RelativePoses, truth: Trajectory) -> tuple[Array, Array, Mask]:
    """Return the tangent errors (n x 6) of motions with truth, their NEES (n), and which of all motions they are."""
    judged = widened(seconds, truth_noise(truth))
    errors, valid = relative_errors_of(judged, truth)
    return errors, nees(errors, judged.covariances[valid]).values, valid


def _ate(trajectory: Trajectory, truth: Trajectory) -> tuple[float | None, int]:
    try:
        report = evaluate(trajectory, truth)
    except InputError:  # nothing was tracked: there is nothing to align
        return None, 0
    return report.ate_m, report.matched
