"""The uncertainty of a near and of a far feature, by the Z-levels of the stream itself: Figure 1 a of the paper."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from odom.errors import InputError
from odom.evaluation.diagnosis.z_levels import shown_levels
from odom.evaluation.physical.front_ends import Look
from odom.frame import Camera
from odom.registration.noise_models import ZLevels, back_project, point_covariances

_NEAR, _FAR = 0.05, 0.95
"""Quantiles of the depths of a stream's features that count as near and as far."""


def read_ellipsoids(looks: Sequence[Look]) -> dict[str, Any]:
    """Return levels, and of a near and a far feature: point (m), covariance by Z-levels and by the model in use.

    Empty where the stream has too few levels. The covariances are 3 x 3, m^2, in the camera's frame (eqs. 20-21 with
    the pixel's own noise).
    """
    levels_m = shown_levels([look.view.depth_mm for look in looks])
    try:
        model = ZLevels(levels_m)
    except InputError:
        return {}
    sensor = looks[0].sensor
    fx, fy, cx, cy = sensor.lens.intrinsics.tolist()
    height, width = looks[0].view.depth_mm.shape
    camera = Camera(width, height, fx, fy, cx, cy)
    points = np.concatenate([look.place.points for look in looks[:: max(1, len(looks) // 12)]])
    if not len(points):
        return {}
    knots, sigma_w = sensor.noise.feature_noise.inverse_depth_sigma
    shown = {}
    for name, share in (("near", _NEAR), ("far", _FAR)):
        z = float(np.quantile(points[:, 2], share))
        point = points[np.argmin(np.abs(points[:, 2] - z))]
        uv = np.array([[fx * point[0] / point[2] + cx, fy * point[1] / point[2] + cy]])
        depth = point[2:].copy()
        in_use = _InUse(
            float(depth[0] ** 2 * np.interp(1 / depth[0], knots, sigma_w)), sensor.noise.feature_noise.pixel_sigma
        )
        shown[name] = {
            "point_m": back_project(camera, uv, depth)[0].tolist(),
            "z_levels": point_covariances(model, camera, uv, depth)[0].tolist(),
            "in_use": point_covariances(in_use, camera, uv, depth)[0].tolist(),
        }
    return {"levels": len(levels_m), **shown}


class _InUse:
    """The noise that the odometry has learnt from the stream, at one depth."""

    def __init__(self, sigma_z_m: float, pixel_sigma: float) -> None:
        self._sigma_z_m, self._pixel_sigma = sigma_z_m, pixel_sigma

    def sigmas(self, depth_m: np.ndarray, incidence_rad: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """See `NoiseModel`."""
        return np.full_like(depth_m, self._pixel_sigma), np.full_like(depth_m, self._sigma_z_m)
