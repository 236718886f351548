"""The truth fields of `report.json`, from the files that `odom run --out` leaves."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from odom.errors import InputError
from odom.evaluation.files import read_tum
from odom.evaluation.plot import ClaimedError, plot
from odom.evaluation.relative import RelativePoses, read_relative, relative_errors_of, relative_nees
from odom.evaluation.report import EvaluationOptions, Report, evaluate
from odom.evaluation.trajectory import Trajectory


def report_with_truth(
    out_dir: Path, *, total_frames: int | None = None, options: EvaluationOptions | None = None
) -> dict[str, Any]:
    """Judge the run in `out_dir` and draw `plot.png` there.

    Reads `trajectory.txt`, `odometry.txt`, `relative_step.txt`, `relative_second.txt` and `truth.txt`. Returns the
    fields of the contract and `truth_notes`, in plain words; a figure that cannot be had is None, with its note.
    Raises SourceError when `trajectory.txt` or `truth.txt` cannot be read.
    """
    options = replace(options or EvaluationOptions(), total_frames=total_frames)
    truth = read_tum(out_dir / "truth.txt")
    estimate = read_tum(out_dir / "trajectory.txt")
    try:
        final = evaluate(estimate, truth, options)
    except InputError as error:
        return {**_nothing(len(estimate), total_frames), "truth_notes": [str(error)]}
    online = _online(out_dir / "odometry.txt", truth, options)
    second = _relative(out_dir / "relative_second.txt")
    step = _relative(out_dir / "relative_step.txt")
    fields = {
        "ate_m": final.ate_m,
        "ate_online_m": online.ate_m if online else None,
        "rpe_frame_m": final.rpe_frame.rmse_m,
        "rpe_frame_deg": final.rpe_frame.rmse_deg,
        "rpe_1s_m": final.rpe_1s.rmse_m,
        "rpe_1s_deg": final.rpe_1s.rmse_deg,
        **_nees_fields(second, truth, options, ""),
        **_nees_fields(step, truth, options, "_step"),
        "matched": final.matched,
        "total": final.total,
        "time_offset_s": None,
        "hand_eye": None,
        "truth_notes": list(final.notes),
    }
    plot(out_dir / "plot.png", final, online, _claimed(second, truth, final, options))
    return {key: _finite(value) for key, value in fields.items()}


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _nothing(poses: int, total_frames: int | None) -> dict[str, Any]:
    names = ("ate_m", "ate_online_m", "rpe_frame_m", "rpe_frame_deg", "rpe_1s_m", "rpe_1s_deg")
    rest = ("nees_mean", "nees_inside_95", "nees_step_mean", "nees_step_inside_95", "time_offset_s", "hand_eye")
    return {**dict.fromkeys(names + rest), "matched": 0, "total": max(total_frames or 0, poses)}


def _online(path: Path, truth: Trajectory, options: EvaluationOptions) -> Report | None:
    if not path.is_file():
        return None
    try:
        return evaluate(read_tum(path), truth, options)
    except InputError:
        return None


def _relative(path: Path) -> RelativePoses | None:
    return read_relative(path) if path.is_file() else None


def _nees_fields(
    poses: RelativePoses | None, truth: Trajectory, options: EvaluationOptions, suffix: str
) -> dict[str, float | None]:
    values = relative_nees(poses, truth, options.max_gap_s) if poses else None
    return {
        f"nees{suffix}_mean": values.mean if values else None,
        f"nees{suffix}_inside_95": values.inside_95 if values else None,
    }


def _claimed(
    poses: RelativePoses | None, truth: Trajectory, final: Report, options: EvaluationOptions
) -> ClaimedError | None:
    if not poses:
        return None
    errors, valid = relative_errors_of(poses, truth, options.max_gap_s)
    if not len(errors):
        return None
    largest = np.linalg.eigvalsh(poses.covariances[valid][:, :3, :3])[:, -1]
    seconds = (poses.stamps_current[valid] - final.truth.stamps[0]) * 1e-9
    return ClaimedError(seconds, np.linalg.norm(errors[:, :3], axis=1), 3 * np.sqrt(np.maximum(largest, 0)))
