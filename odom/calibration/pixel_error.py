"""The error of a calibration in pixels, and the uncertainty of that error."""

import numpy as np

from odom.calibration.parameters import BASELINE, LENS, SHIFT, STRETCH, camera_of, vector_of
from odom.calibration.result import Calibrated
from odom.calibration.survey import Survey
from odom.frame import Camera
from odom.frontend.camera.rays import grid_over, rays_of, turned_onto
from odom.geometry.arrays import Array

_SHIFT_SIGMAS, _SHIFT_FLOOR_PX = 2.0, 0.4
"""Sigmas taken off the measured shift of depth against colour, and the least sigma that one walk can reach."""


def significant_error_px(given: Camera, camera: Camera, sigma: Array, survey: Survey) -> float:
    """Return by how many pixels the camera `given` differs from `camera`, whose 30 parameters have the sigmas `sigma`.

    The largest of three, two of them root mean squares over the image: the difference of the rays after the rotation
    that brings them closest together; the shift of depth against colour at the survey's usual range, less two sigmas;
    and by how much the two images differ in size, less two sigmas.
    """
    if camera == given:
        return 0.0
    uv = grid_over(given)
    rays = rays_of(given, uv)
    turned = turned_onto(rays_of(camera, uv), rays) - rays
    rays_px = float(given.fx * np.sqrt((turned**2).sum(axis=1).mean()))
    moved, usual = vector_of(camera) - vector_of(given), float(np.nanmedian(survey.inverse_depth))
    unsure = np.hypot(np.minimum(sigma[SHIFT], usual * sigma[BASELINE]), _SHIFT_FLOOR_PX)
    shift_px = float(np.linalg.norm(moved[SHIFT] + usual * moved[BASELINE]))
    larger_px = float(np.linalg.norm(stretch_px(given, moved[STRETCH])))
    larger_unsure = np.hypot(stretch_px(given, sigma[STRETCH]), _SHIFT_FLOOR_PX)
    return max(
        rays_px,
        shift_px - _SHIFT_SIGMAS * float(unsure.max()),
        larger_px - _SHIFT_SIGMAS * float(larger_unsure.max()),
    )


def stretch_px(camera: Camera, stretch: Array) -> Array:
    """Return by how many pixels (2) a `stretch` (2) of depth moves it, root mean square over a camera's image."""
    return np.asarray(stretch * grid_over(camera).std(axis=0))


def ray_sigma_px(found: Calibrated) -> float:
    """Return the standard deviation, in pixels, of the rays of an estimated calibration.

    Root mean square over the image, after the rotation that brings them nearest. The parameters' errors are
    correlated: the uncertainty of the centre alone hardly matters.
    """
    free, uv = found.fitted.free, grid_over(found.camera)
    rays = rays_of(found.camera, uv)
    moved = np.zeros((len(free), rays.size))
    for row, k in enumerate(free.tolist()):
        if LENS.start <= k < LENS.stop:
            vector = found.vector.copy()
            vector[k] += found.sigma[k]
            aside = turned_onto(rays_of(camera_of(vector, found.camera), uv), rays) - rays
            moved[row] = aside.ravel() / found.sigma[k]
    variance = np.einsum("ap,ab,bp->p", moved, found.covariance, moved).sum() / len(rays)
    return float(found.camera.fx * np.sqrt(variance))
