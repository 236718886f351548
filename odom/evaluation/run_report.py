"""The truth fields of `report.json`, from the files that `odom run --out` leaves."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from odom.errors import InputError
from odom.evaluation.chain_report import chain_fields, trajectory_fields
from odom.evaluation.files import read_rows, read_run, read_tum
from odom.evaluation.judgement import judge
from odom.evaluation.mocap_calibration import Calibration, CalibrationOptions
from odom.evaluation.pose_conventions import convention_notes
from odom.evaluation.relative import RelativePoses, read_relative, relative_errors_of, relative_nees
from odom.evaluation.report import EvaluationOptions, Report, evaluate
from odom.evaluation.times import leap_note, of_one_time
from odom.evaluation.trajectory import Trajectory
from odom.evaluation.trajectory_plot import ClaimedError, plot
from odom.evaluation.trajectory_plot import load_drawing as load_drawing
from odom.evaluation.truth_noise import truth_noise, widened
from odom.geometry.quaternion import quaternion_from_rotation
from odom.geometry.rotations import angles_of

CAMERA = "camera"
"""Body whose truth is that of the colour camera's optical frame itself, on the camera's own clock."""

_ERRORS = ("ate_m", "ate_online_m", "rpe_frame_m", "rpe_frame_deg", "rpe_1s_m", "rpe_1s_deg")
_NEES = ("nees_mean", "nees_inside_95")
_CALIBRATION = ("time_offset_s", "hand_eye")


def report_with_truth(out_dir: Path, total_frames: int | None = None) -> dict[str, Any]:
    """Judge the run in `out_dir`, draw `plot.png` there, and return the truth fields of `report.json`.

    Reads `trajectory.txt` and the parts beside it, which count as not matched, `odometry.txt`, `relative_step.txt`,
    `relative_second.txt`, `truth.txt`, and the chain's files (see `chain_fields`). Unless the truth is of `camera` (see
    `body_of`), clock offset and hand-eye transformation are estimated and used for every figure. `total_frames` is how
    many the source had, where that is more than have a pose. A figure that cannot be computed is None, and
    `truth_notes` say why. NEES allows for the truth's own noise where its samples show it (see `noise`),
    `..._exact_truth` does not. A plot that cannot be written is noted, too, and counted in `unwritten`.

    Raises SourceError when `trajectory.txt` or `truth.txt` cannot be read.
    """
    estimate = read_run(out_dir)
    read = read_tum(out_dir / "truth.txt", estimate)
    body = body_of(out_dir / "truth.txt")
    leaps = _leaps(out_dir / "odometry.txt")
    options = EvaluationOptions(total_frames=total_frames)
    mocap = CalibrationOptions() if body != CAMERA else None

    def report_by(given: Trajectory) -> Report:
        return judge(estimate, given, options, mocap).report

    try:
        judged = judge(estimate, read, options, mocap)
    except InputError as error:
        notes = [str(error), *convention_notes(read, None, report_by), *leaps]
        nothing = dict.fromkeys(_ERRORS + _NEES + _CALIBRATION)
        return {**nothing, "matched": 0, "total": max(total_frames or 0, len(estimate)), "truth_notes": notes}
    truth, final, calibration = judged.truth, judged.report, judged.calibration
    online = _online(out_dir / "odometry.txt", estimate, truth, options)
    files = (out_dir / "relative_step.txt", out_dir / "relative_second.txt")
    step, second = (read_relative(path, estimate) if path.is_file() else None for path in files)
    fields = {
        **error_fields(final),
        "ate_online_m": online.ate_m if online else None,
        **_nees_fields(second, truth, "nees"),
        **_nees_fields(step, truth, "nees_step"),
        **mocap_calibration_fields(calibration, body),
        "chain": chain_fields(out_dir, truth, options),
        "chain_closed": trajectory_fields(out_dir / "chain_closed.txt", truth, options),
        "truth_notes": [*convention_notes(read, final, report_by), *judged.notes, *leaps],
    }
    try:
        plot(out_dir / "plot.png", final, online, _claimed(second, truth), remarks=remarks(calibration))
    except OSError as error:
        fields |= {"unwritten": 1, "truth_notes": [*fields["truth_notes"], f"plot.png is not drawn: {error}"]}
    return {key: _finite(value) for key, value in fields.items()}


def body_of(path: Path) -> str:
    """Return the body that a truth file is of: the name in its first line, `# body NAME`, else `camera`."""
    with path.open() as file:
        words = file.readline().split()
    return words[2] if len(words) == 3 and words[:2] == ["#", "body"] else CAMERA


def error_fields(report: Report) -> dict[str, Any]:
    """Return a report's errors under the names of the contract."""
    return {
        "ate_m": report.ate_m,
        "rpe_frame_m": report.rpe_frame.rmse_m,
        "rpe_frame_deg": report.rpe_frame.rmse_deg,
        "rpe_1s_m": report.rpe_1s.rmse_m,
        "rpe_1s_deg": report.rpe_1s.rmse_deg,
        "matched": report.matched,
        "total": report.total,
    }


def mocap_calibration_fields(calibration: Calibration | None, body: str) -> dict[str, Any]:
    """Return clock offset and hand-eye with their standard deviations, None for both without a calibration."""
    if calibration is None:
        return dict.fromkeys(_CALIBRATION)
    sigma = calibration.hand_eye_sigma
    return {
        "time_offset_s": calibration.offset_s,
        "time_offset_sigma_s": calibration.offset_sigma_s,
        "hand_eye": {
            "parent": body,
            "child": "camera_optical_frame",
            "translation_m": calibration.T_body_camera[:3, 3].tolist(),
            "quaternion_xyzw": quaternion_from_rotation(calibration.T_body_camera[:3, :3]).tolist(),
            "sigma_m": sigma[:3].tolist(),
            "sigma_deg": np.degrees(sigma[3:]).tolist(),
        },
    }


def remarks(calibration: Calibration | None) -> tuple[str, ...]:
    """Return the calibration in one sentence for the foot of the plot, none without one."""
    if calibration is None:
        return ()
    t, sigma = 1e3 * calibration.T_body_camera[:3, 3], calibration.hand_eye_sigma
    turn = np.degrees(angles_of(calibration.T_body_camera[None, :3, :3])[0])
    return (
        f"Estimated with the alignment: clock offset {1e3 * calibration.offset_s:.1f} ± "
        f"{1e3 * calibration.offset_sigma_s:.1f} ms; camera in marker body ({t[0]:.0f}, {t[1]:.0f}, {t[2]:.0f}) mm "
        f"± {1e3 * sigma[:3].max():.1f}, turned {turn:.1f}° ± {np.degrees(sigma[3:].max()):.2f}.",
    )


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _online(path: Path, final: Trajectory, truth: Trajectory, options: EvaluationOptions) -> Report | None:
    """Return the report of the trajectory in `path`, its segments being those of the `final` one."""
    if not path.is_file():
        return None
    try:
        return evaluate(read_tum(path, final).in_segments_of(final), truth, options)
    except InputError:
        return None


def _leaps(path: Path) -> list[str]:
    """Return what is to be said of a clock that leapt back between the poses in the file `path`, if there is one."""
    if not path.is_file():
        return []
    stamps, _, _ = read_rows(path, "a pose", 1, None, may_be_cut=True)
    note = leap_note(of_one_time(stamps[:, 0]))
    return [note] if note else []


def _nees_fields(poses: RelativePoses | None, truth: Trajectory, name: str) -> dict[str, Any]:
    if not poses:
        return dict.fromkeys((f"{name}_mean", f"{name}_inside_95"))
    exact, judged = (relative_nees(each, truth) for each in (poses, widened(poses, truth_noise(truth))))
    return {
        f"{name}_mean": judged.mean,
        f"{name}_inside_95": judged.inside_95,
        f"{name}_mean_exact_truth": exact.mean,
        f"{name}_inside_95_exact_truth": exact.inside_95,
    }


def _claimed(poses: RelativePoses | None, truth: Trajectory) -> ClaimedError | None:
    if not poses:
        return None
    errors, valid = relative_errors_of(poses, truth)
    if not len(errors):
        return None
    largest = np.linalg.eigvalsh(poses.covariances[valid][:, :3, :3])[:, -1]
    return ClaimedError(
        poses.stamps_current[valid], np.linalg.norm(errors[:, :3], axis=1), 3 * np.sqrt(np.maximum(largest, 0))
    )
