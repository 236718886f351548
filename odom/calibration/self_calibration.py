"""A run that mends the calibration it was given: where another explains it better, all poses are adjusted by that one.

The causal trajectory stays as it was published. How far the calibration moves is what the walk makes probable (see
`prior_width`): a good one hardly does, and is kept where frames that were held out are explained no better.
"""

from dataclasses import dataclass

import numpy as np

from odom.backend import Odometry, TrajectoryPose
from odom.backend.mapping.local_adjustment import Adjustment
from odom.calibration.adjustment import FREE, Fit, Prior, fit, likely_gain, placed, start_of
from odom.calibration.parameters import BASELINE, NAMES, SHIFT, TIMINGS, prior_sigma, vector_of
from odom.calibration.rays import rays_of, turned_onto
from odom.calibration.result import CONTRADICTED, RESTLESS, Calibrated, as_measured, calibrated, judge, restless_share
from odom.calibration.survey import Survey, surveyed
from odom.calibration.tuning import TUNING
from odom.calibration.unit_of_length import in_believed_unit
from odom.errors import ConfigError, InputError
from odom.frame import Camera
from odom.geometry.arrays import Array

_SEED = 1
"""Of the chance that draws landmarks: a run calibrates itself alike every time."""
_GRID = 16, 12
"""Rays that are compared over the image: along its height and its width."""
_GOOD = "good as far as this walk shows: no other explains frames better that were held out"
_SURELY, _SHIFT_FLOOR_PX = 2.0, 0.4
"""Sigmas by which depth must lie beside colour, and the least sigma that is believed of one walk."""
_TIMING = np.arange(TIMINGS)
_TWICE = 2
"""Frames by which a landmark must have been adjusted for other frames to be placed by it."""
_POSE_STEPS = 4
"""Steps of all poses once the camera is known."""


@dataclass(frozen=True, eq=False)
class SelfCalibration:
    """What a run says of its calibration: `found` and the `trajectory` by it, None where the one given is kept.

    `off_px` is how far the rays of the calibration given, or its depth beside colour, seem to be off; `reason` says
    why it is kept.
    """

    off_px: float = 0.0
    reason: str = ""
    found: Calibrated | None = None
    trajectory: tuple[TrajectoryPose, ...] | None = None


def self_calibrated(odometry: Odometry) -> SelfCalibration:
    """Return what an odometry that has finished says of its calibration; deterministic."""
    camera = odometry.camera
    try:
        survey, frames = surveyed(odometry)
        newest = survey.newest(TUNING.self_frames)
        few = newest.of_frames(newest.every_nth(TUNING.self_times)).thinned(TUNING.self_observations, _SEED)
        if likely_gain(few, Prior(vector_of(camera), prior_sigma(camera)), FREE) < TUNING.accept_gain:
            return SelfCalibration(reason=_GOOD)
        found = calibrated(few, camera)
        if found.contradicted:
            return SelfCalibration(reason=CONTRADICTED)
        if (moving := restless_share(few, found)) > TUNING.restless_most:
            return SelfCalibration(reason=RESTLESS.format(moving))
        off_px = surely_off_px(found.camera, found.sigma, few)
        if not judge(few, found).is_better:
            return SelfCalibration(off_px, _GOOD)
        found = as_measured(in_believed_unit(found, few))
        return SelfCalibration(off_px, "", found, _trajectory(odometry, survey, frames, found))
    except (InputError, ConfigError, np.linalg.LinAlgError) as error:
        return SelfCalibration(reason=str(error))


def surely_off_px(camera: Camera, sigma: Array, survey: Survey) -> float:
    """Return how far the camera of a survey is from `camera`, whose numbers have standard deviations `sigma` (28).

    In pixels: root mean square over the image of the rays, after the rotation that brings them nearest, or depth beside
    colour at the survey's usual range less two sigmas, whichever is more.
    """
    given = survey.camera
    rows, columns = (
        np.linspace(0.0, side - 1.0, n) for side, n in zip((given.height, given.width), _GRID, strict=True)
    )
    uv = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    rays = rays_of(given, uv)
    turned = turned_onto(rays_of(camera, uv), rays) - rays
    rays_px = float(given.fx * np.sqrt((turned**2).sum(axis=1).mean()))
    moved, usual = vector_of(camera) - vector_of(given), float(np.nanmedian(survey.inverse_depth))
    unsure = np.hypot(np.minimum(sigma[SHIFT], usual * sigma[BASELINE]), _SHIFT_FLOOR_PX)
    shift_px = float(np.linalg.norm(moved[SHIFT] + usual * moved[BASELINE]))
    return max(rays_px, shift_px - _SURELY * float(unsure.max()))


def _trajectory(
    odometry: Odometry, survey: Survey, frames: Adjustment, found: Calibrated
) -> tuple[TrajectoryPose, ...]:
    """Return the trajectory with all poses of a survey adjusted anew by the camera that was found."""
    vector = found.vector.copy()
    prior = Prior(np.where(np.arange(len(NAMES)) < TIMINGS, 0.0, vector), prior_sigma(odometry.camera))
    kept = survey.every_nth(TUNING.self_times)
    some = survey.of_frames(kept)
    start = Fit(vector, _TIMING, np.eye(TIMINGS), start_of(some))
    by_some = fit(some, prior, _TIMING, start, steps=_POSE_STEPS)
    poses = survey.T_camera_map.copy()
    poses[kept] = by_some.bundle.T_camera_map
    seen_twice = np.bincount(some.landmark, minlength=len(some.landmarks)) >= _TWICE
    rest = survey.part(~kept[survey.frame] & seen_twice[survey.landmark])
    poses = placed(rest, ~kept, poses, by_some, _POSE_STEPS)
    keyframes = len(frames.numbers)
    return odometry.trajectory_with(
        dict(zip(frames.numbers.tolist(), poses[:keyframes], strict=True)),
        dict(zip(frames.between.tolist(), poses[keyframes:], strict=True)),
    )
