"""`odom doctor SOURCE`: whether a source is good enough, and what is wrong with it."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from odom.cli import signals
from odom.cli.options import Calibration, OwnTopics, Seed, SimulatedSensor, SourceName, SourceOption, Start, pairs

if TYPE_CHECKING:
    from odom.evaluation.diagnosis import Finding, Recording
    from odom.frame import Camera, RgbdFrame
    from odom.wire import Message, Topics

_MOST_FRAMES = 900
"""Frames kept in memory, 0.9 MB each: 30 s at 30 Hz, the longest that may be asked for."""
_WARM_UP, _TIMED = 20, 90
"""Frames before the clock counts (compiling, loading) and frames timed, 3 s: their median stands still by then."""
_BUSIEST = 0.8
"""Share of the time between two frames that the odometry may take: the rest is for decoding and other processes."""


def doctor(
    source: SourceName,
    seconds: Annotated[float, typer.Option(min=1, max=30, help="How much of the source to look at.")] = 10.0,
    start: Start = 0.0,
    camera: Calibration = None,
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
    import json

    import cv2

    from odom.evaluation.diagnosis import Verdict, examine
    from odom.service.progress import counting
    from sensors.catalogue import open_source
    from sensors.source import SourceOptions

    cv2.setNumThreads(1)
    stop = signals.stop_event()
    options = SourceOptions(
        camera=camera, start=start, topics_from=pairs("--topic", topic), sensor=kind, seed=seed,
        extra=pairs("--option", option),
    )  # fmt: skip
    opened = open_source(source, options)
    try:
        with counting("looking", round(30 * seconds)) as progress:
            messages = _until(opened.messages(), stop.is_set)
            recording = collect(messages, options.topics, seconds, progress)
    finally:
        opened.close()
    findings = examine(recording)
    if recording.camera and recording.frames:
        findings.append(judge_speed(recording.frames, recording.camera))
    for finding in findings:
        typer.echo(f"{finding.verdict.value:>10}  {finding.key:<18}  {finding.value}")
        if finding.advice:
            typer.echo(f"{'':>10}  {'':<18}  -> {finding.advice}")
    bad = [finding.key for finding in findings if finding.verdict is Verdict.BAD]
    typer.echo(f"{source}: " + (f"mend first: {', '.join(bad)}" if bad else "nothing would spoil the odometry"))
    if json_file:
        json_file.write_text(json.dumps([_as_dict(finding) for finding in findings], indent=2) + "\n")
    if bad:
        raise typer.Exit(1)


def collect(
    messages: "Iterable[Message]", topics: "Topics", seconds: float, progress: Callable[[int], None]
) -> "Recording":
    """Return the first `seconds` of colour, depth, calibration and truth from the messages of a source."""
    import numpy as np

    from odom.errors import WireError
    from odom.evaluation.diagnosis import Recording
    from odom.evaluation.trajectory import Trajectory
    from odom.wire.assembler import FrameAssembler
    from odom.wire.codec import decode_pose

    assembler = FrameAssembler(topics, grey=True)
    frames: list[RgbdFrame] = []
    color: list[int] = []
    depth: list[int] = []
    truth: dict[str, dict[int, np.ndarray[tuple[int, ...], np.dtype[np.float64]]]] = {}
    for message in messages:
        if message.topic in (topics.color, topics.color_compressed):
            color.append(message.stamp)
            progress(len(color))
        elif message.topic in (topics.depth, topics.depth_compressed):
            depth.append(message.stamp)
        elif message.topic.startswith("truth/"):
            try:
                truth.setdefault(message.topic.split("/")[1], {})[message.stamp] = decode_pose(message).T_parent_child
            except WireError:
                continue
        frames += assembler.feed(message)
        if (color and color[-1] - color[0] > seconds * 1e9) or len(frames) >= _MOST_FRAMES:
            break
    frames += assembler.finish()
    trajectories = {
        body: Trajectory(np.array(sorted(poses), dtype=np.int64), np.array([poses[stamp] for stamp in sorted(poses)]))
        for body, poses in truth.items()
    }
    stamps = (np.unique(np.array(values, dtype=np.int64)) for values in (color, depth))
    return Recording(next(stamps), next(stamps), tuple(frames), assembler.camera, trajectories)


def judge_speed(frames: "tuple[RgbdFrame, ...]", camera: "Camera") -> "Finding":
    """Measure the odometry itself on the first frames, by wall clock and CPU, against the time between two frames."""
    import time

    import numpy as np

    from odom.backend import Odometry, OdometrySettings
    from odom.evaluation.diagnosis import Finding, Verdict

    odometry = Odometry(camera, OdometrySettings())
    spent = []
    for frame in frames[: _WARM_UP + _TIMED]:
        begin = time.perf_counter(), time.process_time()
        odometry.process(frame)
        spent.append((time.perf_counter() - begin[0], time.process_time() - begin[1]))
    odometry.finish()
    if len(spent) <= _WARM_UP:
        return Finding("speed", "too few frames to time", Verdict.UNKNOWN)
    wall, cpu = np.median(spent[_WARM_UP:], axis=0)
    period = float(np.median(np.diff([frame.stamp for frame in frames]))) * 1e-9
    value = f"{1e3 * wall:.0f} ms a frame ({1e3 * cpu:.0f} ms CPU) of {1e3 * period:.0f} ms: {wall / period:.0%} busy"
    if cpu > _BUSIEST * period:
        advice = "this computer is too slow for the rate: send fewer frames a second"
        return Finding("speed", value, Verdict.BAD, advice)
    if wall > _BUSIEST * period:
        return Finding("speed", value, Verdict.UNKNOWN, "other programs take the CPU: stop them and look again")
    return Finding("speed", value, Verdict.GOOD)


def _until(messages: "Iterable[Message]", stopped: Callable[[], bool]) -> "Iterable[Message]":
    for message in messages:
        if stopped():
            return
        yield message


def _as_dict(finding: "Finding") -> dict[str, str]:
    return {
        "check": finding.key, "value": finding.value, "verdict": finding.verdict.value, "advice": finding.advice,
    }  # fmt: skip
