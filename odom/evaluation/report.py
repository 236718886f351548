"""All errors of one estimate against truth."""

from dataclasses import dataclass
from numbers import Integral, Real

import numpy as np

from odom.errors import InputError, check_type
from odom.evaluation import metrics
from odom.evaluation.alignment import Alignment, align
from odom.evaluation.metrics import RelativeError
from odom.evaluation.trajectory import Trajectory, check
from odom.frame.brief import brief
from odom.geometry.arrays import Array

_LEAST = 3
"""Poses that an alignment needs."""
_MOST = 0.9
"""Share of the frames below which a note says that the figures are not those of the whole recording."""


@dataclass(frozen=True)
class EvaluationOptions:
    """How estimate and truth are brought together.

    `max_gap_s`: truth is interpolated between neighbours at most this far apart; `total_frames`: frames that the
    source had, when it is known and larger than the number of estimated poses.

    Raises InputError for seconds or numbers of frames that are none, or below 0.
    """

    max_gap_s: float = 0.1
    total_frames: int | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.max_gap_s, Real) or not self.max_gap_s >= 0.0:
            raise InputError(f"max_gap_s is {self.max_gap_s!r}: give seconds, 0 or more")
        if not isinstance(self.total_frames, Integral | None) or (self.total_frames or 0) < 0:
            raise InputError(f"total_frames is {self.total_frames!r}: give a number of frames, 0 or more, or None")


@dataclass(frozen=True, eq=False, repr=False)
class Report:
    """The errors of an estimate; `estimate_aligned` and `truth` hold the matched poses in the truth's world."""

    ate_m: float
    rpe_frame: RelativeError
    rpe_1s: RelativeError
    matched: int
    total: int
    alignment: Alignment
    estimate_aligned: Trajectory
    truth: Trajectory
    errors_m: Array
    notes: tuple[str, ...]

    __repr__ = brief


def evaluate(estimate: Trajectory, truth: Trajectory, options: EvaluationOptions | None = None) -> Report:
    """Return the errors of `estimate` against `truth`, interpolated at the estimate's stamps.

    Truth is of the camera, by the camera's clock. Of a marker body it is made so by
    `odom.calibrate(estimate, truth).camera_truth(truth)`; a run's `truth.txt` names its body in the first line.

    Of an estimate in several segments the longest is judged, of truth in several the longest is what it is judged by;
    the others count as not matched. A frame's relative error is between poses that follow each other without a hole
    (see `pairs_of_neighbours`). Raises InputError when fewer than three poses can be matched in time, or one is no
    rigid motion.
    """
    check_type("options", options, EvaluationOptions | None, "EvaluationOptions(max_gap_s=...), or None")
    options = options or EvaluationOptions()
    for name, given in (("estimate", estimate), ("truth", truth)):
        check(name, given)
    segments, truth = truth.segment_count, truth.longest_segment()
    valid = truth.at(estimate.stamps, options.max_gap_s)[1]
    total = max(options.total_frames or 0, len(estimate))
    if valid.sum() < _LEAST:
        raise InputError(_why_unmatched(estimate, truth, int(valid.sum()), options.max_gap_s))
    everything = estimate.take(valid)
    matched = everything.longest_segment()
    if len(matched) < _LEAST:
        raise InputError(f"the longest of the estimate's segments has {len(matched)} poses: nothing to align")
    true = Trajectory(matched.stamps, truth.at(matched.stamps, options.max_gap_s)[0])
    alignment = align(matched.positions, true.positions)
    aligned = matched.moved(alignment.T_truth_estimate)
    errors = np.linalg.norm(aligned.positions - true.positions, axis=1)
    stamps, P, Q = matched.stamps, aligned.T_world_body, true.T_world_body
    period_s = float(np.median(np.diff(stamps))) * 1e-9
    return Report(
        ate_m=metrics.rmse(errors),
        rpe_frame=metrics.relative_error(P, Q, *metrics.pairs_of_neighbours(stamps)),
        rpe_1s=metrics.relative_error(P, Q, *metrics.pairs_apart(stamps, 1.0, 0.75 * period_s)),
        matched=len(matched),
        total=total,
        alignment=alignment,
        estimate_aligned=aligned,
        truth=true,
        errors_m=errors,
        notes=(
            *alignment.notes,
            *_segment_notes("estimate", everything.segment_count, "is judged"),
            *_segment_notes("truth", segments, "is judged by"),
            *_coverage_notes(len(matched), total),
        ),
    )


def _segment_notes(name: str, count: int, use: str) -> tuple[str, ...]:
    if count < 2:
        return ()
    return (f"the {name} has {count} segments that were never joined: only the longest {use}",)


def _coverage_notes(matched: int, total: int) -> tuple[str, ...]:
    if matched < _MOST * total:
        return (
            f"only {matched} of {total} frames ({matched / total:.0%}) are judged: the rest has no pose or no truth",
        )
    return ()


def _why_unmatched(estimate: Trajectory, truth: Trajectory, matched: int, max_gap_s: float) -> str:
    if not len(estimate) or not len(truth):
        return f"{len(estimate)} estimated and {len(truth)} true poses: nothing to compare"
    if len(estimate) < _LEAST:
        return (
            f"the estimate has only {len(estimate)} pose{'s' if len(estimate) > 1 else ''}: three are needed to compare"
        )
    span = [f"{t.stamps[0] * 1e-9:.3f} .. {t.stamps[-1] * 1e-9:.3f} s" for t in (estimate, truth)]
    return (
        f"only {matched} of {len(estimate)} poses match truth in time (estimate {span[0]}, truth {span[1]}, "
        f"gaps in truth up to {max_gap_s} s): check that both use the same clock and unit of time"
    )
