"""One sensor's part of the physical experiment: a program that walks a source and prints what came of it.

It reads one JSON argument, a `Task`, and writes one line, `{...}`, the fields of a `Part`. Its progress is in the file
`progress` of its folder.
"""

import json
import logging
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from odom.bench.physical_walk import Walk, walk
from odom.errors import OdomError, RecordingError
from odom.evaluation.mocap_calibration import calibrate
from odom.evaluation.paper.benchmark import ESTIMATORS
from odom.evaluation.physical.ellipsoids import read_ellipsoids
from odom.evaluation.physical.front_ends import FrontEnd, Look, pairs_by, small_picture
from odom.evaluation.physical.judging import Outcome, Truth, judge
from odom.evaluation.physical.wrong_pairs import spoil
from odom.evaluation.run_report import CAMERA
from odom.evaluation.trajectory import Trajectory
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.registration import Pairs, warm_up
from odom.service.settings import load_settings
from sensors.catalogue import open_source
from sensors.source import SourceOptions

_MOST_GAP_S = 0.1
"""Truth is interpolated over gaps of at most so long."""
_SPOILT_SETS = 16
"""Sets of pairs, spread over the walk, whose correct pairs are spoilt: more take longer and move the means by 2 %."""


@dataclass(frozen=True)
class Task:
    """What one process is to do; `sensor` is the arena's, empty for a recording."""

    source: str
    folder: str
    pairs: int
    seed: int
    sensor: str = ""
    camera: str | None = None
    config: str | None = None


@dataclass
class Part:
    """What one sensor gave: outcomes of all pairs, of the closing test, of spoilt pairs; what the figure shows.

    `walk_m` are the camera's true positions; `ellipsoids` see `read_ellipsoids`; `notes` say what was left out.
    """

    outcomes: list[dict[str, Any]] = field(default_factory=list)
    closing: list[dict[str, Any]] = field(default_factory=list)
    spoilt: list[dict[str, Any]] = field(default_factory=list)
    walk_m: list[list[float]] = field(default_factory=list)
    ellipsoids: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    error: str = ""


def main(argument: str) -> None:
    """Do one task; what fails is told in the part's `error`."""
    import cv2

    cv2.setNumThreads(1)
    logging.disable()
    task = Task(**json.loads(argument))
    try:
        part = run(task)
    except OdomError as error:
        part = Part(error=str(error))
    print(json.dumps(asdict(part)), flush=True)


def run(task: Task) -> Part:
    """Walk the source, and judge all pairs by all front-ends and estimators. Raises OdomError where that cannot be."""
    extra = (("exact_truth", "true"),) if task.source == "arena" else ()
    given = {"sensor": task.sensor, "seed": task.seed, "extra": extra} if task.source == "arena" else {}
    options = SourceOptions(camera=Path(task.camera) if task.camera else None, **given)  # type: ignore[arg-type]  # of mixed types
    settings = load_settings(Path(task.config) if task.config else None).odometry
    source = open_source(task.source, options)
    frames = source.length or 0
    steps = frames + task.pairs + _SPOILT_SETS
    found = walk(source, options.topics, settings, task.pairs, lambda done: _report(task, done / steps))
    part = Part()
    best, lab = _truths(found, part)
    part.walk_m = [T[:3, 3].tolist() for T in _poses(best, found.looks) if np.isfinite(T).all()]
    _judge_pairs(task, found, part, (best, lab), lambda done: _report(task, (frames + done) / steps))
    part.ellipsoids = read_ellipsoids(found.looks)
    picture = Path(task.folder) / f"scene-{task.sensor}.png"
    import cv2

    cv2.imwrite(str(picture), cv2.cvtColor(small_picture(found.looks[0].color), cv2.COLOR_RGB2BGR))
    _report(task, 1.0)
    return part


def _truths(found: Walk, part: Part) -> tuple[Trajectory, Trajectory]:
    """Return the best truth of the camera and that of the motion capture, through clock offset and hand-eye."""
    if not found.truth:
        raise RecordingError("no truth: the experiment is judged on a recording with motion capture")
    exact = next((body for body in ("exact_camera", CAMERA) if body in found.truth), None)
    body = next((name for name in found.truth if name != "exact_camera"), exact)
    assert body is not None
    calibration = calibrate(found.trajectory, found.truth[body])
    lab = calibration.camera_truth(found.truth[body])
    part.notes += [
        f"motion capture of '{body}': clock offset {1e3 * calibration.offset_s:.2f} ms, hand-eye "
        f"{1e3 * np.linalg.norm(calibration.T_body_camera[:3, 3]):.1f} mm and "
        f"{np.degrees(np.linalg.norm(se3.so3_log(calibration.T_body_camera[:3, :3]))):.2f} deg",
        *calibration.notes,
    ]
    return (lab if exact is None else found.truth[exact]), lab


def _poses(truth: Trajectory, looks: list[Look]) -> Array:
    """Return the true poses of looks (n x 4 x 4), NaN where truth has a gap."""
    return truth.at(np.array([look.view.stamp for look in looks], dtype=np.int64), _MOST_GAP_S)[0]


def _judge_pairs(task: Task, found: Walk, part: Part, truths: tuple[Trajectory, Trajectory], progress: Any) -> None:
    best, lab = (_poses(truth, found.looks) for truth in truths)

    def truth_of(source: int, target: int) -> Truth | None:
        T, T_lab = (np.linalg.inv(poses[target]) @ poses[source] for poses in (best, lab))
        return Truth(T, T_lab if np.isfinite(T_lab).all() else None) if np.isfinite(T).all() else None

    _warm_up()
    outcomes: list[Outcome] = []
    sets: list[tuple[Pairs, Array]] = []
    without_truth = 0
    for number, each in enumerate(found.pairs):
        truth = truth_of(each.source, each.target)
        if truth is None:
            without_truth += 1
            continue
        for front_end in FrontEnd:
            pairs = pairs_by(front_end, found.looks[each.source], found.looks[each.target], each.followed)
            outcomes += judge(pairs, truth, number, front_end.value)
            if front_end is FrontEnd.FOLLOWED and number % max(1, len(found.pairs) // _SPOILT_SETS) == 0:
                sets.append((pairs, truth.T))
        progress(number + 1)
    if without_truth:
        part.notes.append(f"{without_truth} of {len(found.pairs)} pairs left out: truth has a gap there")
    part.outcomes = [asdict(outcome) for outcome in outcomes]
    last, first = len(found.looks) - 1, 0
    closing = truth_of(last, first)
    if closing is not None:
        for front_end in (FrontEnd.ORB, FrontEnd.SIFT3D):
            pairs = pairs_by(front_end, found.looks[last], found.looks[first])
            part.closing += [asdict(outcome) for outcome in judge(pairs, closing, -1, front_end.value)]
    part.spoilt = [asdict(each) for each in spoil(task.sensor, sets[:_SPOILT_SETS], task.seed)]


def _warm_up() -> None:
    """Compile or load all estimators, so that none is late at the first pairs."""
    warm_up()
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (8, 3))
    pairs = Pairs(points, points, None, np.full((8, 3), 1e-6))
    for estimator in ESTIMATORS.values():
        estimator(pairs)


def _report(task: Task, share: float) -> None:
    file = Path(task.folder) / f"progress-{task.sensor}"
    partial = file.with_suffix(".part")
    partial.write_text(f"{share:.4f}")
    partial.replace(file)  # so that a reader never finds half a number


if __name__ == "__main__":
    main(sys.argv[1])
