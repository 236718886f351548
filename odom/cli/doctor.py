"""`odom doctor SOURCE`: whether a source is good enough, and what is wrong with it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from odom.cli import signals
from odom.cli.options import (
    Calibration,
    MaskFile,
    OwnTopics,
    Seed,
    SimulatedSensor,
    SourceName,
    SourceOption,
    Start,
    pairs,
)
from odom.cli.outputs import check_files, write_json

if TYPE_CHECKING:
    from odom.backend.odometry.segmentation import Segmenter
    from odom.evaluation.diagnosis import Finding
    from odom.frame import Camera, RgbdFrame

_WARM_UP, _TIMED = 20, 90
"""Frames before the clock counts (compiling, loading) and frames timed, 3 s: their median stands still by then."""
_BUSIEST = 0.8
"""Share of the time between two frames that the odometry may take: the rest is for decoding and other processes."""
_LOOKED_AT = 30
"""Depth images whose levels are counted."""


def doctor(
    source: SourceName,
    seconds: Annotated[float, typer.Option(min=1, max=30, help="How much of the source to look at.")] = 10.0,
    start: Start = 0.0,
    camera: Calibration = None,
    mask: MaskFile = None,
    topic: OwnTopics = None,
    option: SourceOption = None,
    kind: SimulatedSensor = "kinect1",
    seed: Seed = 1,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write the findings to this file.")] = None,
) -> None:
    """Look at ten seconds of SOURCE and say in plain words what would spoil the odometry, and what to do.

    Move the camera meanwhile: step sideways and turn it. Each line is a measurement with its verdict. Exit status 1
    when something is bad.

    Example: odom doctor kinect
    """
    from dataclasses import replace

    import cv2

    from odom.calibration.examine import examine_calibration
    from odom.evaluation.diagnosis import Verdict, examine
    from odom.service.mask_file import masked_by, read_mask
    from odom.service.source_sample import look_at
    from sensors.catalogue import check_images, open_source
    from sensors.source import SourceOptions

    check_images(source)
    cv2.setNumThreads(1)
    check_files(json_file)
    given = None if mask is None else read_mask(mask)
    stop = signals.stop_event()
    options = SourceOptions(
        camera=camera, start=start, topics_from=pairs("--topic", topic), sensor=kind, seed=seed,
        extra=pairs("--option", option),
    )  # fmt: skip
    recording = replace(look_at(open_source(source, options), options.topics, seconds, stop.is_set), mask=given)
    findings = examine(recording.as_corrected())
    if recording.camera and recording.frames:
        findings += judge_odometry(recording.frames, recording.camera, masked_by(mask, recording.camera))
        if not any(finding.verdict is Verdict.BAD for finding in findings) and recording.paired:
            findings += examine_calibration(recording.paired, recording.camera, recording.truth, stop.is_set)
    for finding in findings:
        typer.echo(f"{finding.verdict.value:>10}  {finding.key:<18}  {finding.value}")
        if finding.advice:
            typer.echo(f"{'':>10}  {'':<18}  -> {finding.advice}")
    bad = [finding.key for finding in findings if finding.verdict is Verdict.BAD]
    typer.echo(f"{source}: " + (f"mend first: {', '.join(bad)}" if bad else "nothing would spoil the odometry"))
    if json_file:
        write_json(json_file, [_as_dict(finding) for finding in findings], indent=2)
    if bad:
        raise typer.Exit(1)


def judge_odometry(
    frames: "tuple[RgbdFrame, ...]", camera: "Camera", segmenter: "Segmenter | None" = None
) -> "list[Finding]":
    """Judge by the odometry itself, on the first frames: the noise of depth as it takes it, tracking, and speed."""
    import time

    import numpy as np

    from odom.backend import Odometry, OdometrySettings
    from odom.backend.odometry.moving_view import DOUBTS
    from odom.evaluation.diagnosis import judge_levels, judge_tracking

    odometry = Odometry(camera, OdometrySettings(), segmenter=segmenter)
    spent, reasons, inliers, doubtful = [], [], [], 0
    for frame in frames[: _WARM_UP + _TIMED]:
        begin = time.perf_counter(), time.process_time()
        estimate = odometry.process(frame)
        spent.append((time.perf_counter() - begin[0], time.process_time() - begin[1]))
        is_doubtful = estimate.reason.endswith(DOUBTS)
        has_pose = is_doubtful or estimate.state.is_trusted
        reasons.append(None if has_pose else estimate.reason or estimate.state.value)
        inliers.append(estimate.inliers)
        doubtful += is_doubtful
    odometry.finish_map()
    some = frames[:: max(1, len(frames) // _LOOKED_AT)]
    levels = judge_levels([frame.depth_mm for frame in some], odometry.sensor.noise.feature_noise)
    period_s = float(np.median(np.diff([frame.stamp for frame in frames]))) * 1e-9 if len(frames) > 1 else 0.0
    return [levels, judge_tracking(reasons, inliers, doubtful), _judge_speed(spent[_WARM_UP:], period_s)]


def _judge_speed(spent_s: "list[tuple[float, float]]", period_s: float) -> "Finding":
    """Judge the time a frame by wall clock and CPU against the time between two frames."""
    import numpy as np

    from odom.evaluation.diagnosis import Finding, Verdict

    if not spent_s or not period_s:
        return Finding("speed", "too few frames to time", Verdict.UNKNOWN)
    wall, cpu = np.median(spent_s, axis=0)
    busy = (
        f"{1e3 * wall:.0f} ms a frame ({1e3 * cpu:.0f} ms CPU) of {1e3 * period_s:.0f} ms: {wall / period_s:.0%} busy"
    )
    if cpu > _BUSIEST * period_s:
        advice = "this computer is too slow for the rate: send fewer frames a second"
        return Finding("speed", busy, Verdict.BAD, advice)
    if wall > _BUSIEST * period_s:
        return Finding("speed", busy, Verdict.UNKNOWN, "other programs take the CPU: stop them and look again")
    return Finding("speed", busy, Verdict.GOOD)


def _as_dict(finding: "Finding") -> dict[str, str]:
    return {
        "check": finding.key, "value": finding.value, "verdict": finding.verdict.value, "advice": finding.advice,
    }  # fmt: skip
