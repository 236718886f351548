"""One run of the robustness bench: a program that runs the odometry over a spoilt source and prints its verdict.

It reads one JSON argument, a `Task`, and writes one line, `{...}`, the verdict.
"""

import json
import logging
import sys
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path

from odom.errors import RecordingError
from odom.evaluation.files import read_tum, write_tum
from odom.evaluation.mocap_calibration import calibrate
from odom.evaluation.passers_by import nearer_than
from odom.evaluation.robustness.axes import AXES
from odom.evaluation.robustness.spoiler import UNSPOILT, Scene
from odom.evaluation.robustness.verdict import Verdict, verdict
from odom.evaluation.run_report import CAMERA
from odom.evaluation.trajectory import Trajectory
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.service.replayed import Replayed, frames_of, replay
from odom.service.settings import load_settings
from sensors.catalogue import open_source
from sensors.source import SourceOptions

_LOOKS, _LOOK_EVERY = 40, 10
"""Frames at the beginning that tell how far away the scene is, of which every tenth is looked at."""

_ESTIMATED, _TIMING = "estimated.txt", "timing.json"
"""Files beside that of the truth."""


@dataclass(frozen=True)
class Task:
    """What one run is to do: an axis and the number of its level, or None for the unspoilt run.

    The first unspoilt run writes the camera's truth to the file `truth`, and what it estimated beside it; the others
    read that.
    """

    source: str
    truth: str
    seed: int
    end: float | None = None
    camera: str | None = None
    config: str | None = None
    axis: str | None = None
    level: int = 0


def main(argument: str) -> None:
    """Do one task and print what came of it."""
    print(json.dumps(asdict(outcome(Task(**json.loads(argument))))), flush=True)


def outcome(task: Task) -> Verdict:
    """Do one task without a word in the log; what fails is a verdict that says so."""
    import cv2

    cv2.setNumThreads(1)
    logging.disable()
    try:
        return run(task)
    except Exception as error:  # any failure is the verdict on the run
        return Verdict(error=f"{type(error).__name__}: {error}")


def run(task: Task) -> Verdict:
    """Run the odometry over the source as spoilt, and judge it; raises OdomError where it has no frames or no truth."""
    camera, config = (None if path is None else Path(path) for path in (task.camera, task.config))
    options, settings = SourceOptions(camera=camera, end=task.end), load_settings(config).odometry
    spoiler, file = UNSPOILT, Path(task.truth)
    if task.axis is not None:
        scene = look(task, options, read_tum(file))
        spoiler = next(axis for axis in AXES if axis.name == task.axis).spoiler(task.level, scene)
    replayed = replay(open_source(task.source, options), options.topics, settings, spoiler)
    if not file.exists():
        write_tum(file, camera_truth(replayed))
        write_tum(file.with_name(_ESTIMATED), replayed.trajectory)
        file.with_name(_TIMING).write_text(json.dumps(asdict(replayed.timing)))
    return verdict(replayed.estimates, replayed.trajectory, read_tum(file), spoiler.light_returns)


def look(task: Task, options: SourceOptions, truth: Trajectory) -> Scene:
    """Return the scene as its first frames show it."""
    source = open_source(task.source, options)
    try:
        first = list(islice(frames_of(source.messages(), options.topics), _LOOKS))
    finally:
        source.close()
    camera, frame = first[0]
    near_m, beside = nearer_than([each for _, each in first[::_LOOK_EVERY]]), Path(task.truth)
    timing = ShutterTiming(**json.loads(beside.with_name(_TIMING).read_text()))
    return Scene(task.seed, frame.stamp, camera, truth, near_m, read_tum(beside.with_name(_ESTIMATED)), timing)


def camera_truth(replayed: Replayed) -> Trajectory:
    """Return the truth of the camera's optical frame on its clock, of markers by calibration, as `odom run` does.

    Raises RecordingError without truth, InputError where it cannot be calibrated.
    """
    if not replayed.truth:
        raise RecordingError("no truth: robustness is judged on a recording with motion capture")
    body, truth = next(iter(replayed.truth.items()))
    return truth if body == CAMERA else calibrate(replayed.trajectory, truth).camera_truth(truth)


if __name__ == "__main__":
    main(sys.argv[1])
