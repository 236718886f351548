"""Whether the odometry tracks the recording: this also shows faults that no other check finds."""

from collections import Counter
from collections.abc import Sequence
from statistics import median

from odom.evaluation.diagnosis.finding import Finding, Verdict

_LEAST_SHARE = 0.9
"""Share of frames tracked in a recording that is good enough; a second in the dark at its start costs less."""


def judge_tracking(reasons: Sequence[str | None], inliers: Sequence[int], doubtful: int = 0) -> Finding:
    """Judge the share of frames tracked; `reasons` are None for a tracked frame, else why it was not.

    `doubtful` of the tracked frames are UNCERTAIN, since most of the view moves.
    """
    key = "tracking"
    tracked = sum(reason is None for reason in reasons)
    if not reasons:
        return Finding(key, "no frames", Verdict.UNKNOWN)
    used = [count for count, reason in zip(inliers, reasons, strict=True) if reason is None]
    value = f"{tracked} of {len(reasons)} frames tracked"
    if used:
        value += f", usually by {median(used):.0f} points"
    if doubtful:
        value += f"; in {doubtful} of them most of the view moves, or depth is of another time than colour"
    lost = Counter(reason for reason in reasons if reason is not None)
    if lost:
        value += "; lost: " + ", ".join(f"{count} by {reason}" for reason, count in lost.most_common(3))
    advice = (
        "the odometry loses the camera: mend first what else is bad; if nothing is, move slower, and keep objects with "
        "corners at 0.6 .. 4 m in view"
    )
    return Finding.judged(key, value, tracked < _LEAST_SHARE * len(reasons), advice)
