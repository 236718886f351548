"""One frame against the map: predicted, followed from the previous image, found in key frames' patches, fitted."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from odom.backend.keyframes import Measured
from odom.backend.map import Map
from odom.backend.motion import ANY_VELOCITY, Agility, Motion, Velocity
from odom.backend.pose import PoseFit, fit_pose
from odom.backend.rows import fit_velocity
from odom.backend.search import look_for
from odom.backend.settings import OdometrySettings
from odom.frame import Camera
from odom.frontend.images import FrameImages, follow
from odom.frontend.lens import Lens, project, rays_at
from odom.frontend.measure import FeatureNoise, Measurements, measure
from odom.frontend.timing import Timing
from odom.frontend.view import View
from odom.registration import se3

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_FOLLOWED = 150
_LEAST_FOLLOWED = 15
_GATES_PX = (30.0, 6.0, 1.5)
_GATE_CAUCHY = 4.0
_FAR_CHI2 = 16.0
INLIER_CHI2 = 12.0
_IMAGE_NOISE_LEVELS = 3.0
_RANK_OF_REFERENCE = 3.0
_WHITE = Agility(steady_s=0.0)


@dataclass(frozen=True, eq=False)
class Before:
    """The camera's `motion` in the map `since_s` seconds ago; `scale` multiplies the covariances of measurements."""

    motion: Motion
    since_s: float
    scale: float

    def twist_to(self, T_camera_map: Array) -> Array:
        """Return the mean velocity (6, SI, the camera's own frame) that led to the pose `T_camera_map`."""
        return np.asarray(-se3.log(T_camera_map @ self.motion.T_fixed_camera) / self.since_s)


@dataclass(frozen=True, eq=False)
class Tracked:
    """A frame's pose `T_camera_map` for its middle row, with the information of the fit (6 x 6, camera frame).

    `rows` (n) are the landmarks found, at `uv` (n x 2 px), with their `measurements`, `chi2` (n x 2) and `inliers`
    (n); `expected` are the rows of all that were looked for, `reference` the key frame nearest in pose, `twist` the
    camera's velocity (SI, its own frame) that the measurements were carried with, `velocity` what the rows told of it.
    """

    T_camera_map: Array
    information: Array
    rows: Index
    uv: Array
    measurements: Measurements
    chi2: Array
    inliers: NDArray[np.bool_]
    expected: Index
    reference: int
    twist: Array
    velocity: Velocity

    @property
    def looked_for(self) -> int:
        """How many landmarks were looked for."""
        return len(self.expected)

    @cached_property
    def inlying(self) -> Measured:
        """The landmarks found where the pose says."""
        return Measured(self.rows[self.inliers], self.uv[self.inliers], self.measurements.take(self.inliers))

    @property
    def inlier_count(self) -> int:
        """How many landmarks were found where the pose says."""
        return int(np.count_nonzero(self.inliers))

    @property
    def found_again(self) -> int:
        """How many landmarks were found where the pose says, and at the depth it says where depth was measured."""
        return int(np.count_nonzero(self.inliers & (self.chi2[:, 1] < INLIER_CHI2)))

    @property
    def covariance(self) -> Array:
        """The pose's 6 x 6 covariance (`se3`, camera frame) that the measurements' own imply."""
        return np.asarray(np.linalg.inv(self.information), dtype=np.float64)


def coarse_pose(
    map_: Map,
    rows: Index,
    uv_previous: Array,
    previous: FrameImages,
    current: FrameImages,
    lens: Lens,
    T_predicted: Array,
) -> Array:
    """Return T_camera_map from landmarks `rows` followed from the previous image, the prediction where too few are.

    The fit's gate closes from 30 px to 1.5 px (graduated non-convexity), so that a wrong prediction does no harm.
    """
    if len(rows) > _FOLLOWED:
        chosen = np.linspace(0, len(rows) - 1, _FOLLOWED).astype(np.int64)
        rows, uv_previous = rows[chosen], uv_previous[chosen]
    height, width = current.full.shape
    L = map_.landmarks
    seen = project(L.position[rows], T_predicted, lens.intrinsics, lens.distortion, width, height, 2.0)
    guess = np.where(np.isnan(seen[:, :2]), uv_previous, seen[:, :2])
    uv, found = follow(previous.full, current.full, uv_previous, guess)
    values = np.full((len(rows), 3), np.nan)
    values[:, :2] = rays_at(lens.rays, np.where(found[:, None], uv, 0.0))
    pixel = np.array([lens.intrinsics[0] ** -2, 0.0, lens.intrinsics[1] ** -2, 1.0])
    T = T_predicted
    for sigma_px in _GATES_PX:
        variances = np.tile(pixel * sigma_px**2, (len(rows), 1))
        fit = fit_pose(L.position[rows], L.covariance[rows], values, variances, T, found, cauchy=_GATE_CAUCHY)
        T = fit.T_camera_map
    agreed = np.count_nonzero(found & (fit.chi2[:, 0] < _FAR_CHI2))
    return T if agreed >= _LEAST_FOLLOWED else T_predicted


def track(
    map_: Map,
    view: View,
    camera: Camera,
    lens: Lens,
    T_start: Array,
    twist: Array,
    local: Index,
    timing: Timing,
    noise: FeatureNoise,
    settings: OdometrySettings,
    before: Before | None = None,
) -> Tracked:
    """Find the landmarks of the key frames `local` where `T_start` (T_camera_map) predicts them, and fit.

    The first of `local` becomes the reference: its landmarks come first where there are more than are looked for. With
    the motion `before`, the twist is taken anew from the rows, and they are moved and fitted with that: with a noisy
    one the shutter would seem faster than it is.
    """
    L = map_.landmarks
    reference = int(local[0])
    T_map_start = se3.inverse(T_start)
    keyframes = np.sort(local)
    T_camera_keyframe = np.array([se3.inverse(map_.keyframes[k].T_camera_map @ T_map_start) for k in keyframes])
    is_local = np.zeros(len(map_.keyframes), dtype=np.bool_)
    is_local[keyframes] = True
    candidates = np.flatnonzero(L.alive & is_local[L.keyframe])
    priority = L.seen[candidates] + _RANK_OF_REFERENCE * (L.keyframe[candidates] == reference)
    found = look_for(
        L,
        candidates,
        priority,
        T_start,
        keyframes,
        T_camera_keyframe,
        view.images,
        camera,
        lens,
        settings.max_features,
    )
    covariance_uv = found.covariance_uv * _IMAGE_NOISE_LEVELS**2
    points, covariances = L.position[found.rows], L.covariance[found.rows]

    def fitted(twist: Array, T: Array) -> tuple[Measurements, PoseFit]:
        m = measure(view.frame, lens, found.uv, covariance_uv, twist, timing, noise, found.inverse_depth)
        return m, fit_pose(points, covariances, m.values, m.covariance, T)

    measured, fit = fitted(twist, T_start)
    velocity = ANY_VELOCITY
    if before is not None:
        row_s = (found.uv[:, 1] / camera.height - 0.5) * timing.readout_s
        expected = before.motion.after(before.since_s, _WHITE)
        velocity = fit_velocity(points, covariances, measured, row_s, fit.T_camera_map, twist, expected, before.scale)
        twist = velocity.twist
        measured, fit = fitted(twist, fit.T_camera_map)
    inliers = fit.chi2[:, 0] < INLIER_CHI2
    return Tracked(
        fit.T_camera_map,
        fit.information,
        found.rows,
        found.uv,
        measured,
        fit.chi2,
        inliers,
        found.looked_for,
        reference,
        twist,
        velocity,
    )
