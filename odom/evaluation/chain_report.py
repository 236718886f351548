"""The chain's entry of `report.json`: how good successive registrations alone are, from the files of a run."""

from pathlib import Path
from typing import Any

from odom.errors import InputError
from odom.evaluation.files import read_tum
from odom.evaluation.relative import read_relative, relative_nees
from odom.evaluation.report import EvaluationOptions, evaluate
from odom.evaluation.trajectory import Trajectory
from odom.evaluation.truth_noise import truth_noise, widened

_ERRORS = ("ate_m", "rpe_frame_m", "rpe_frame_deg", "rpe_1s_m", "rpe_1s_deg")


def chain_fields(out_dir: Path, truth: Trajectory, options: EvaluationOptions) -> dict[str, Any]:
    """Return the errors of `chain.txt` against `truth` of the camera, and the NEES of its links.

    NEES allows for the truth's own noise where its samples show it, `..._exact_truth` does not. A figure that cannot be
    computed is None. After a hole the chain goes on from its last pose: its error then includes the motion over the
    hole.
    """
    fields: dict[str, Any] = trajectory_fields(out_dir / "chain.txt", truth, options)
    fields |= dict.fromkeys(("nees_frame", "nees_frame_exact_truth"))
    path = out_dir / "relative_chain.txt"
    links = read_relative(path, truth) if path.is_file() else None
    if links:
        exact = relative_nees(links, truth)
        if len(exact.values):
            judged = relative_nees(widened(links, truth_noise(truth)), truth)
            fields |= {"nees_frame": judged.mean, "nees_frame_exact_truth": exact.mean}
    return fields


def trajectory_fields(path: Path, truth: Trajectory, options: EvaluationOptions) -> dict[str, Any]:
    """Return the errors of the trajectory in the file `path`, each None where they cannot be computed."""
    try:
        report = evaluate(read_tum(path, truth), truth, options) if path.is_file() else None
    except InputError:
        report = None
    if report is None:
        return dict.fromkeys(_ERRORS)
    frame, second = report.rpe_frame, report.rpe_1s
    values = (report.ate_m, frame.rmse_m, frame.rmse_deg, second.rmse_m, second.rmse_deg)
    return {name: value if value == value else None for name, value in zip(_ERRORS, values, strict=True)}
