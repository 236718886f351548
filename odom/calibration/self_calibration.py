"""A run that mends the calibration it was given: where that is clearly poor, all poses are adjusted with a better one.

The causal trajectory stays as it was published. A good calibration is kept even where a fit explains the run a little
better: a walk of half a minute shows the numbers of a camera less surely than a calibration that somebody made.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from odom.backend import Odometry, TrajectoryPose
from odom.backend.mapping.bundle_adjustment import Bundle
from odom.backend.mapping.local_adjustment import Adjustment
from odom.calibration.adjustment import FREE, Fit, Prior, fit
from odom.calibration.held_out import residuals
from odom.calibration.parameters import BASELINE, NAMES, SHIFT, TIMINGS, camera_of, prior_sigma, vector_of
from odom.calibration.result import Calibrated, calibrated, judge
from odom.calibration.survey import Survey, surveyed
from odom.calibration.tuning import TUNING
from odom.errors import ConfigError, InputError
from odom.frame import Camera
from odom.geometry.arrays import Array

_SEED = 1
"""Of the chance that draws landmarks: a run calibrates itself alike every time."""
_GRID = 12, 16
"""Rays that are compared over the image, rows and columns."""
_GLANCE_SHARE = 0.85
"""Share of what makes a calibration poor above which one step of a fit is not enough to call it good."""
_GOOD = "good as far as this walk shows"
_SURELY, _SHIFT_FLOOR_PX = 2.0, 0.4
"""Sigmas by which depth must lie beside colour, and the least sigma that is believed of one walk."""
_TIMING = np.arange(TIMINGS)
_GLANCE_ROUNDS, _POSE_ROUNDS = 1, 2
"""Linearisations: of a first look, and of all poses once the camera is known."""


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
        few = survey.newest(TUNING.self_frames).thinned(TUNING.self_observations, _SEED)
        off_px = _glance(few)
        if off_px is not None:
            return SelfCalibration(off_px, _GOOD)
        found = calibrated(few, camera)
        off_px, judgement = surely_off_px(found.camera, found.sigma, few), judge(few, found)
        if not judgement.is_better:
            return SelfCalibration(off_px, "no other explains frames better that were held out")
        gain = 1.0 - judgement.after.ray_cost / judgement.before.ray_cost
        if off_px < TUNING.self_poor_px and gain < TUNING.self_gain:
            return SelfCalibration(off_px, _GOOD)
        return SelfCalibration(off_px, "", found, _trajectory(odometry, survey, frames, found))
    except (InputError, ConfigError, np.linalg.LinAlgError) as error:
        return SelfCalibration(reason=str(error))


def _glance(survey: Survey) -> float | None:
    """Return how far the camera of a survey is off where one step of a fit finds it good; None where it does not."""
    start = vector_of(survey.camera)
    prior = Prior(start, prior_sigma(survey.camera))
    found = fit(survey, prior, FREE, rounds=_GLANCE_ROUNDS)
    sigma = np.zeros(len(NAMES))
    sigma[FREE] = np.sqrt(np.diag(np.linalg.inv(found.information)))
    off_px = surely_off_px(camera_of(found.vector, survey.camera), sigma, survey)
    if off_px > _GLANCE_SHARE * TUNING.self_poor_px:
        return None
    kept = fit(survey, prior, _TIMING, rounds=_GLANCE_ROUNDS)
    gain = 1.0 - residuals(survey, found).ray_cost / residuals(survey, kept).ray_cost
    return off_px if gain < _GLANCE_SHARE * TUNING.self_gain else None


def surely_off_px(camera: Camera, sigma: Array, survey: Survey) -> float:
    """Return how far the camera of a survey is from `camera`, whose numbers have standard deviations `sigma` (28).

    In pixels: root mean square over the image of the rays, after the rotation that brings them nearest, or depth beside
    colour at the survey's usual range less two sigmas, whichever is more.
    """
    given = survey.camera
    rays, rays_given = _rays(camera), _rays(given)
    U, _, Vt = np.linalg.svd(rays.T @ rays_given)
    R_given_camera = Vt.T @ np.diag([1.0, 1.0, np.linalg.det(Vt.T @ U.T)]) @ U.T
    turned = rays @ R_given_camera.T - rays_given
    rays_px = float(given.fx * np.sqrt((turned**2).sum(axis=1).mean()))
    moved, usual = vector_of(camera) - vector_of(given), float(np.nanmedian(survey.inverse_depth))
    unsure = np.hypot(np.minimum(sigma[SHIFT], usual * sigma[BASELINE]), _SHIFT_FLOOR_PX)
    shift_px = float(np.linalg.norm(moved[SHIFT] + usual * moved[BASELINE]))
    return max(rays_px, shift_px - _SURELY * float(unsure.max()))


def _rays(camera: Camera) -> Array:
    rows, columns = (
        np.linspace(0.0, side - 1.0, n) for side, n in zip((camera.height, camera.width), _GRID, strict=True)
    )
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 1, 2)
    xy = cv2.undistortPoints(pixels, camera.matrix, np.array(camera.distortion or (0.0,) * 5)).reshape(-1, 2)
    rays = np.column_stack([xy, np.ones(len(xy))])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _trajectory(
    odometry: Odometry, survey: Survey, frames: Adjustment, found: Calibrated
) -> tuple[TrajectoryPose, ...]:
    """Return the trajectory with all poses of a survey adjusted anew by the camera that was found."""
    vector = found.vector.copy()
    start = Fit(vector, _TIMING, np.eye(TIMINGS), Bundle(survey.T_camera_map, survey.landmarks, np.zeros(0)))
    prior = Prior(np.where(np.arange(len(NAMES)) < TIMINGS, 0.0, vector), prior_sigma(odometry.camera))
    poses = fit(survey, prior, _TIMING, start, rounds=_POSE_ROUNDS).bundle.T_camera_map
    keyframes = len(frames.numbers)
    return odometry.trajectory_with(
        dict(zip(frames.numbers.tolist(), poses[:keyframes], strict=True)),
        dict(zip(frames.between.tolist(), poses[keyframes:], strict=True)),
    )
