"""Corrects a run's calibration: if another explains the measurements better, all poses are adjusted with it.

The causal trajectory stays as it was published. How far the calibration moves is what the walk makes probable (see
`prior_width`): a good one hardly does, and is kept where frames that were held out are explained no better.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from odom.backend import Odometry, TrajectoryPose
from odom.backend.mapping.map_adjustment import Adjustment
from odom.calibration.adjustment import FREE, Prior, System, fit, likely_gain, placed, start_of
from odom.calibration.parameters import NAMES, TIMINGS, prior_sigma, vector_of
from odom.calibration.pixel_error import ray_sigma_px, significant_error_px
from odom.calibration.result import CONTRADICTED, RESTLESS, Calibrated, as_measured, calibrated, judge, restless_share
from odom.calibration.survey import Survey, survey_of, surveyed
from odom.calibration.tuning import TUNING
from odom.calibration.unit_of_length import in_believed_unit
from odom.errors import ConfigError, InputError
from odom.frame import Camera
from odom.frontend.camera.rays import turn_between

_SEED = 1
"""Seed of the random choice of landmarks: a run gives the same calibration every time."""
GOOD = "good as far as this walk shows: no other explains frames better that were held out"
_UNSURE = "the walk does not show another one surely"
_TIMING = np.arange(TIMINGS)
_TWICE = 2
"""Frames by which a landmark must have been adjusted for other frames to be placed by it."""
_POSE_STEPS = 4
"""Steps of all poses once the camera is known."""


@dataclass(frozen=True, eq=False)
class SelfCalibration:
    """What a run says of its calibration: `found` and the `trajectory` by it, None where the one given is kept.

    `off_px` is how far the rays of the calibration given, or its depth against colour, seem to be off; `reason` says
    why it is kept.
    """

    off_px: float = 0.0
    reason: str = ""
    found: Calibrated | None = None
    trajectory: tuple[TrajectoryPose, ...] | None = None


def self_calibrated(odometry: Odometry, earlier: SelfCalibration | None = None) -> SelfCalibration:
    """Return what an odometry whose map is finished says of its calibration; deterministic.

    `earlier` is what was found in mid-run and is in use since, None where nothing was.
    """
    try:
        found = better_camera(survey_of(odometry), odometry.camera)
        if found.found is None:
            return earlier or found
        return replace(found, trajectory=_trajectory(odometry, *surveyed(odometry), found.found))
    except (InputError, ConfigError, np.linalg.LinAlgError) as error:
        return earlier or SelfCalibration(reason=str(error))


def better_camera(
    survey: Survey, given: Camera, is_sure: Callable[[Calibrated], bool] = lambda found: True
) -> SelfCalibration:
    """Return a better camera than that of the survey, which is in use, or why none is found.

    `given` is the camera that the user gave. A calibration that is not `is_sure` is not tried on frames held out.
    Raises InputError, ConfigError, LinAlgError.
    """
    newest, in_use = survey.newest(TUNING.self_frames), survey.camera
    few = newest.of_frames(newest.every_nth()).thinned(TUNING.self_observations, _SEED)
    begin = System.at_start(few, FREE)
    if likely_gain(begin, Prior(vector_of(in_use), prior_sigma(in_use))) < TUNING.accept_gain:
        return SelfCalibration(reason=GOOD)
    found = calibrated(few, given, begin=begin)
    if found.contradicted:
        return SelfCalibration(reason=CONTRADICTED)
    if (moving := restless_share(few, found)) > TUNING.restless_most:
        return SelfCalibration(reason=RESTLESS.format(moving))
    off_px = significant_error_px(given, found.camera, found.sigma, few)
    reported = as_measured(in_believed_unit(found, few))
    own_px = ray_sigma_px(found)
    is_nearer = off_px**2 - own_px**2 > own_px**2  # the expected squares of the errors of the two
    if not is_nearer or not is_sure(reported) or not judge(few, found).is_better:
        return SelfCalibration(off_px, GOOD if off_px <= own_px else _UNSURE)
    return SelfCalibration(off_px, "", reported)


def _trajectory(
    odometry: Odometry, survey: Survey, frames: Adjustment, found: Calibrated
) -> tuple[TrajectoryPose, ...]:
    """Return the trajectory with all poses of a survey adjusted anew by the camera that was found.

    Like all published poses, these are in the frame of the camera given.
    """
    vector = found.vector.copy()
    given = odometry.camera
    prior = Prior(np.where(np.arange(len(NAMES)) < TIMINGS, 0.0, vector), prior_sigma(given))
    kept = survey.every_nth()
    some = survey.of_frames(kept)
    by_some = fit(System.of(some, vector, start_of(some), _TIMING), prior, steps=_POSE_STEPS)
    poses = survey.T_camera_map.copy()
    poses[kept] = by_some.bundle.T_camera_map
    seen_twice = np.bincount(some.landmark, minlength=len(some.landmarks)) >= _TWICE
    rest = survey.part(~kept[survey.frame] & seen_twice[survey.landmark])
    poses = placed(rest, ~kept, poses, by_some, _POSE_STEPS)
    poses[:, :3] = turn_between(found.camera, given) @ poses[:, :3]
    keyframes = len(frames.numbers)
    return odometry.final_trajectory(
        dict(zip(frames.numbers.tolist(), poses[:keyframes], strict=True)),
        dict(zip(frames.between.tolist(), poses[keyframes:], strict=True)),
    )
