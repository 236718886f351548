"""Calibration from recordings: run, adjust, run again with what was found, and judge the result."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from odom.backend import Odometry, OdometrySettings, State
from odom.calibration.metric_scale import metric_scale
from odom.calibration.parameters import NAMES, vector_of
from odom.calibration.result import (
    CONTRADICTED,
    RESTLESS,
    Calibrated,
    Judgement,
    as_measured,
    calibrated,
    judge,
    restless_share,
)
from odom.calibration.same_camera import apart, halves, is_of_another_camera, most_different
from odom.calibration.several_recordings import joined
from odom.calibration.survey import Survey, survey_of
from odom.calibration.tuning import TUNING
from odom.calibration.unit_of_length import in_metres, in_unit_of_depth
from odom.errors import ConfigError, InputError, RecordingError
from odom.evaluation.diagnosis.scale import ScaleFit
from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera
from odom.service.mask_file import masked_by
from odom.service.replayed import TruePoses, frames_of, noting_truth
from odom.wire import Topics
from sensors.source import Source

ROUNDS = 3
"""Times that the recordings are run and adjusted: the measurements depend on the calibration used for them."""
_LEAST_TRACKED = 0.6
"""Share of frames that must be tracked: else the camera given is far off, or the recording is no walk."""
_SETTLED = 1.0
"""Largest change of a number from round to round, in sigmas, after which no other round follows."""
_DIFFERENT = 8.0
"""Sigmas by which a number never differs in two recordings of one camera, even where the first round's sigmas are too
small."""
DIFFERENT_LENS = 2.7
"""Sigmas, root mean square, by which the lens never differs once the calibration has settled: at most 1.9 in halves of
sixteen walks in the arena and of fr1, 2.5 in halves of a walk of 4 s; 2.8 and more where the second half was zoomed by
3 or 6 %."""


@dataclass(frozen=True, eq=False)
class Walk:
    """One recording, run with a camera: its own calibration, survey, final trajectory, truth by body."""

    recorded: Camera
    survey: Survey
    trajectory: Trajectory
    truth: Mapping[str, Trajectory]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a calibration gave: `start` and the `result` after `rounds`, and how it was judged (None: interrupted).

    `scale` is the ratio of measured to true displacement before it was corrected, None without motion capture.
    `halves_apart` is the difference in sigmas between the lenses found in the two halves of a single recording.
    """

    start: Camera
    result: Calibrated
    survey: Survey
    judgement: Judgement | None
    scale: ScaleFit | None
    rounds: int
    halves_apart: float = 0.0


def calibrate_recordings(
    open_sources: Sequence[Callable[[], Source]],
    topics: Topics,
    settings: OdometrySettings,
    progress: Callable[[str], Callable[[int], None]],
    stopped: Callable[[], bool],
    mask: Path | None = None,
) -> Outcome:
    """Return the calibration that recordings of one camera show; `open_sources` opens each one anew.

    `progress` begins a stage by name and returns what counts its frames. Once `stopped` says so, the best so far is
    returned. What the image file `mask` marks is not looked at. Raises InputError when a recording cannot be used, and
    why; ConfigError for a wrong mask.
    """
    start: Camera | None = None
    best: Outcome | None = None
    for number in range(1, ROUNDS + 1):
        walks = []
        for k, open_source in enumerate(open_sources):
            count = progress(f"round {number}, recording {k + 1}")
            camera = None if best is None else best.result.camera
            walks.append(walk(open_source(), topics, settings, camera, count, stopped, mask))
            if start is None:
                start = walks[0].recorded
            if stopped():
                break
        assert start is not None
        if stopped() and best is not None:
            break
        survey = joined([one.survey for one in walks])
        progress("adjusting")
        scale = _scale(walks)
        earlier = None if best is None else best.result
        if len(walks) > 1 and number == 1:
            _check_same_camera([_calibrated(one.survey, start, None, stopped) for one in walks])
        result = _calibrated(survey, start, earlier, stopped)
        result = in_unit_of_depth(result, survey) if scale is None else in_metres(result, survey, scale)
        best = Outcome(start, result, survey, None, scale if best is None else best.scale, number)
        if stopped() or (earlier is not None and _has_settled(earlier, result)):
            break
    assert best is not None
    if len(walks) > 1 and not stopped():
        _check_same_camera([_calibrated(one.survey, best.start, None, stopped) for one in walks], is_settled=True)
    halves_apart = _halves_apart(best, stopped) if len(walks) == 1 else 0.0
    best = replace(best, result=as_measured(best.result), halves_apart=halves_apart)
    if stopped():
        return best
    if is_of_another_camera(best.result):
        raise InputError(_of_another_camera(best.result.camera, best.start))
    if (moving := restless_share(best.survey, best.result)) > TUNING.restless_most:
        raise InputError(RESTLESS.format(moving))
    progress("judging")
    return replace(best, judgement=judge(best.survey, best.result, stopped))


def walk(
    source: Source,
    topics: Topics,
    settings: OdometrySettings,
    camera: Camera | None,
    count: Callable[[int], None],
    stopped: Callable[[], bool],
    mask: Path | None = None,
) -> Walk:
    """Run the odometry over a source with `camera` (None: its own); `count` is called with the frames done.

    What the image file `mask` marks is not looked at. Raises InputError when too little can be tracked.
    """
    odometry: Odometry | None = None
    truth: TruePoses = {}
    recorded, frames, tracked = None, 0, 0
    try:
        for calibration, frame in frames_of(noting_truth(source.messages(), truth), topics):
            recorded = recorded or calibration
            if odometry is None:
                odometry = Odometry(camera or calibration, settings, segmenter=masked_by(mask, calibration))
            tracked += odometry.process(frame).state is State.TRACKING
            frames += 1
            count(frames)
            if stopped():
                break
    finally:
        source.close()
    if odometry is None or recorded is None:
        raise RecordingError(
            "no frame with a calibration: give --camera with one of this camera's image size; look with odom doctor"
        )
    if tracked < _LEAST_TRACKED * frames:
        raise InputError(
            f"{tracked} of {frames} frames could be tracked: the calibration given is far from this camera's, or the "
            "recording is too dark, too quick or too empty; look at it with odom doctor"
        )
    trajectory = Trajectory.of(odometry.finish())
    bodies = {body: Trajectory.by_stamp(poses, trajectory) for body, poses in truth.items()}
    return Walk(recorded, survey_of(odometry), trajectory, bodies)


def _scale(walks: Sequence[Walk]) -> ScaleFit | None:
    """Return the surest ratio of measured to true displacement of several recordings."""
    found = [fit for one in walks if (fit := metric_scale(one.trajectory, one.truth)) is not None]
    return min(found, key=lambda fit: fit.sigma, default=None)


def _calibrated(survey: Survey, start: Camera, earlier: Calibrated | None, stopped: Callable[[], bool]) -> Calibrated:
    """Return what `calibrated` does; raises InputError where a recording leads to no camera that is possible."""
    vector_of(start)  # the error names a lens model that cannot be calibrated
    try:
        found = calibrated(survey, start, earlier, stopped)
    except (np.linalg.LinAlgError, ConfigError) as error:
        raise InputError(
            f"the recording leads to no possible camera ({error}): is the scene still, and the calibration given that "
            "of this camera?"
        ) from error
    if found.contradicted:
        raise InputError(CONTRADICTED)
    return found


def _check_same_camera(each: Sequence[Calibrated], is_settled: bool = False) -> None:
    """Raise InputError where the lenses found in single recordings differ by more than their sigmas allow.

    `is_settled`: they were measured with the calibration found from all of them, so that their sigmas can be believed.
    """
    first, *others = each
    for number, other in enumerate(others, start=2):
        at, sigmas = most_different(first, other)
        if sigmas > _DIFFERENT or (is_settled and apart(first, other) > DIFFERENT_LENS):
            raise InputError(
                f"recordings 1 and {number} are of different cameras, or one is spoilt: {NAMES[at]} is "
                f"{first.vector[at]:.1f} px in the one and {other.vector[at]:.1f} px in the other "
                f"({sigmas:.0f} sigma apart); calibrate them one by one"
            )


def _of_another_camera(found: Camera, given: Camera) -> str:
    return (
        f"the calibration given is that of another camera: its focal lengths are {given.fx:.0f} and {given.fy:.0f} px, "
        f"the walk shows some {found.fx:.0f} and {found.fy:.0f}: give one of this camera, or begin with those"
    )


def _halves_apart(outcome: Outcome, stopped: Callable[[], bool]) -> float:
    """Return by how many sigma the lenses of the survey's halves differ; 0 where one of them shows too little."""
    try:
        return apart(*(_calibrated(half, outcome.start, None, stopped) for half in halves(outcome.survey)))
    except InputError:
        return 0.0


def _has_settled(earlier: Calibrated, result: Calibrated) -> bool:
    moved = np.abs(result.vector - earlier.vector) / result.sigma
    return bool((moved[result.shown] < _SETTLED).all())
