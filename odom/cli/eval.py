"""`odom eval ESTIMATE TRUTH`: how far off a trajectory is."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from odom.errors import ConfigError

if TYPE_CHECKING:
    from odom.evaluation.mocap_calibration import CalibrationOptions

AUTO, OFF = "auto", "off"


def evaluate(
    estimate: Annotated[
        Path,
        typer.Argument(help="Estimate: TUM, EuRoC or KITTI text, .mcap, a ROS bag, or a folder that `odom run` left."),
    ],
    truth: Annotated[
        Path | None,
        typer.Argument(help="Truth: the same, or Motive's CSV. May be left out where ESTIMATE holds it."),
    ] = None,
    mocap: Annotated[
        bool, typer.Option("--mocap", help="Truth is of markers on the camera rig, by another clock: estimate both.")
    ] = False,
    time_offset: Annotated[
        str | None, typer.Option(help="auto, off, or seconds to add to the estimate's stamps to get the truth's.")
    ] = None,
    hand_eye: Annotated[
        str | None, typer.Option(help="auto, off, or 'tx ty tz qx qy qz qw' of the camera in the marker body.")
    ] = None,
    relative: Annotated[
        list[Path] | None, typer.Option(help="File of relative poses with covariance, for the NEES; may be repeated.")
    ] = None,
    plot: Annotated[Path | None, typer.Option(help="Write a picture of the errors to this .png or .pdf.")] = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the figures to this file.")] = None,
    max_gap: Annotated[float, typer.Option(help="Interpolate truth over gaps up to this many seconds.")] = 0.1,
    search: Annotated[
        float | None, typer.Option(help="Look for the clock offset within this many seconds; default 5, or everywhere.")
    ] = None,
    body: Annotated[str | None, typer.Option(help="Rigid body of a Motive file that holds several.")] = None,
    z_up: Annotated[bool, typer.Option("--z-up", help="The Motive file was exported with z up, not y.")] = False,
    times: Annotated[Path | None, typer.Option(help="Times of KITTI poses, seconds, one a line.")] = None,
    topic: Annotated[str, typer.Option(help="Topic of the estimate in a recording.")] = "cam0/pose",
    truth_topic: Annotated[str | None, typer.Option(help="Topic of the truth in a recording.")] = None,
) -> None:
    """Print ATE, RPE, coverage and calibration of ESTIMATE against TRUTH.

    Alignment is rigid, never scaled; truth is interpolated at the frames' stamps, never extrapolated. ATE is after
    alignment by positions, as evo computes it. The line `by poses` is after alignment by positions and orientations,
    each weighted by its covariance: for a camera that hardly moves, only this one finds the orientation.

    Example: odom eval out/trajectory.txt groundtruth.txt --plot plot.png

    Example: odom eval out motive.csv --body rig --mocap --relative out/relative_second.txt
    """
    from functools import partial
    from math import degrees

    from odom.cli.outputs import check_files, write_json
    from odom.cli.pose_figures import print_pose_figures
    from odom.cli.trajectories import frames_of_run, read_claims, read_estimate, read_truth
    from odom.errors import writing_to
    from odom.evaluation import EvaluationOptions
    from odom.evaluation.judgement import judge as judged_by
    from odom.evaluation.pose_conventions import notes_of_both
    from odom.evaluation.relative import read_relative, relative_nees
    from odom.evaluation.run_report import error_fields, mocap_calibration_fields, remarks
    from odom.evaluation.trajectory_plot import plot as draw
    from odom.evaluation.truth_noise import truth_noise, widened

    for option, seconds in (("--max-gap", max_gap), ("--search", search)):
        if seconds is not None and not seconds >= 0.0:
            raise ConfigError(f"{option} {seconds}: give seconds, 0 or more")
    for path in (estimate, truth):
        if path is not None and not path.exists():
            raise ConfigError(f"{path}: no such file or folder")
    check_files(json_file, plot)
    estimated = read_estimate(estimate, times=times, topic=topic)
    as_read, foreign = read_truth(
        truth or estimate, times=times, topic=truth_topic, body=body, y_up=not z_up, of_run=truth is None
    )
    mocap_options = _calibration_options(mocap or foreign, time_offset, hand_eye, max_gap, search)
    evaluation_options = EvaluationOptions(max_gap, frames_of_run(estimate))
    judge = partial(judged_by, options=evaluation_options, mocap=mocap_options)
    judged = judge(estimated, as_read)
    calibration, true, report = judged.calibration, judged.truth, judged.report

    print(f"matched        {report.matched} / {report.total} frames, {report.truth.duration_s:.1f} s")
    print(f"ATE            {report.ate_m:.4f} m")
    for name, error in (("RPE a frame", report.rpe_frame), ("RPE 1 s", report.rpe_1s)):
        print(f"{name:<14} {error.rmse_m:.4f} m  {error.rmse_deg:.3f} deg  ({error.pairs} pairs)")
    fields = {**error_fields(report), **mocap_calibration_fields(calibration, body or "body")}
    noise = truth_noise(true)
    if noise:
        print(f"truth's noise  {1e3 * noise.sigma_m:.2f} mm  {degrees(noise.sigma_rad):.3f} deg an axis, at least")
    fields["pose_alignment"] = print_pose_figures(report, read_claims(estimate, topic=topic), calibration, noise)
    for path in relative or []:
        poses = read_relative(path, estimated)
        exact, allowing = (relative_nees(each, true, max_gap) for each in (poses, widened(poses, noise)))
        print(f"NEES           {exact.mean:.2f} (6 is ideal), {exact.inside_95:.1%} inside 95 %  {path.name}")
        if noise:
            print(f"{'':<14} {allowing.mean:.2f}, {allowing.inside_95:.1%} inside, allowing for the truth's own noise")
        name = f"nees_{path.stem}"
        fields[f"nees_{path}" if name in fields else name] = {
            "mean": allowing.mean,
            "inside_95": allowing.inside_95,
            "mean_exact_truth": exact.mean,
            "inside_95_exact_truth": exact.inside_95,
        }
    if calibration:
        _print_calibration(mocap_calibration_fields(calibration, body or "body"), calibration.correlation)
    notes = [
        *notes_of_both(estimated, as_read, report, lambda one, other: judge(one, other).report),
        *judged.notes,
    ]
    for note in notes:
        print(f"note: {note}")
    if plot:
        with writing_to(plot):
            draw(plot, report, title=estimate.name, remarks=remarks(calibration))
    if json_file:
        write_json(json_file, {**fields, "notes": notes}, indent=2)


def _print_calibration(fields: dict[str, object], correlation: float) -> None:
    hand_eye = fields["hand_eye"]
    assert isinstance(hand_eye, dict)
    metres = "  ".join(
        f"{v:+.4f} ± {s:.4f}" for v, s in zip(hand_eye["translation_m"], hand_eye["sigma_m"], strict=True)
    )
    quaternion = " ".join(f"{v:+.5f}" for v in hand_eye["quaternion_xyzw"])
    sigma = " ".join(f"{v:.2f}" for v in hand_eye["sigma_deg"])
    how = "imposed" if correlation != correlation else f"speeds correlate {correlation:.2f}"
    print(f"time offset    {fields['time_offset_s']:+.4f} ± {fields['time_offset_sigma_s']:.4f} s ({how})")
    print(f"hand-eye       camera in body, m: {metres}")
    print(f"               quaternion x y z w: {quaternion}, ± {sigma} deg")


def _calibration_options(
    foreign: bool, time_offset: str | None, hand_eye: str | None, max_gap: float, search: float | None
) -> "CalibrationOptions | None":
    import numpy as np
    from scipy.spatial.transform import Rotation

    from odom.evaluation.mocap_calibration import LARGEST_OFFSET_S, CalibrationOptions

    time_offset, hand_eye = (value or (AUTO if foreign else OFF) for value in (time_offset, hand_eye))
    if time_offset == hand_eye == OFF:
        return None
    offset_s, T_body_camera = 0.0 if time_offset == OFF else None, np.eye(4) if hand_eye == OFF else None
    if time_offset not in (AUTO, OFF):
        try:
            offset_s = float(time_offset)
        except ValueError:
            offset_s = np.nan
        if not abs(offset_s) <= LARGEST_OFFSET_S:
            raise ConfigError(f"--time-offset {time_offset}: give auto, off or seconds")
    if hand_eye not in (AUTO, OFF):
        try:
            values = np.array([float(value) for value in hand_eye.replace(",", " ").split()])
            if not np.isfinite(values).all():
                raise ValueError("not finite")
            T_body_camera = np.eye(4)
            T_body_camera[:3, :3] = Rotation.from_quat(values[3:]).as_matrix()
            T_body_camera[:3, 3] = values[:3]
        except ValueError:
            raise ConfigError(f"--hand-eye {hand_eye}: give auto, off or 'tx ty tz qx qy qz qw'") from None
    return CalibrationOptions(offset_s, T_body_camera, max_gap, search)
