"""A frame's pose from its colour image alone: by constant velocity, improved by optical flow from the frame before."""

from dataclasses import dataclass

import numpy as np

from odom.backend.map.landmarks import Landmarks
from odom.backend.map.map import Map
from odom.backend.tracking.consensus import FollowedFeatures, consensus, is_contested, is_exact
from odom.backend.tracking.frame_state import FrameState
from odom.backend.tracking.motions import motions_from
from odom.backend.tracking.pose_solver import fit_pose
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.lens import Lens, project, rays_at
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.images import FrameImages
from odom.frontend.matching.landmark_search import Candidates, find_coarsely
from odom.frontend.matching.optical_flow import follow_features
from odom.geometry.arrays import Array, Index, Mask

_BORDER_PX = 2.0
"""Followed features are predicted up to so close to the image's border."""
_GATES_PX = (TUNING.coarse_gate_px, TUNING.middle_gate_px, TUNING.last_gate_px)


def predict_pose(map_: Map, state: FrameState, images: FrameImages, stamp: SteadyStamp, sensor: SensorModel) -> Array:
    """Return T_camera_map of the `images` taken at `stamp`, after the frame of `state`.

    As long as the camera moves about as it did, patches are found around where constant velocity puts them. Where it
    surprises, features are followed from the image before, however far they went: the fit's gate closes step by step
    (graduated non-convexity), so that a wrong constant velocity does no harm. Where many features disagree with it, the
    motion is chosen that most of the image shows. Where too few are followed the constant velocity stands.
    """
    since_s = state.since_s(stamp)
    T_predicted = state.predicted_after(since_s)
    landmarks = map_.landmarks
    followed = _search(map_, state, images, T_predicted, sensor)
    coarse = followed.fitted(T_predicted, followed.found, _GATES_PX[1:])
    least = max(TUNING.followed_least, TUNING.unsurprised_share * len(followed.rows))
    if np.count_nonzero(coarse.agrees) < least or is_contested(followed.found & ~coarse.agrees, followed.found):
        followed = _follow(landmarks, state, images, T_predicted, sensor.lens)
        coarse = followed.fitted(T_predicted, followed.found, _GATES_PX)
    features = followed.features(landmarks, state.T_map_camera[:3, 3])
    rival = None
    if is_contested(followed.found & ~coarse.agrees, followed.found):
        rival = consensus(features, coarse.T_camera_map, state.expected_after(since_s))
    elif is_exact(features, T_predicted, coarse.T_camera_map):
        rival = T_predicted
    if rival is not None:
        members = followed.fitted(rival, followed.found, ()).agrees
        coarse = followed.fitted(rival, members, _GATES_PX[-1:])
    return coarse.T_camera_map if np.count_nonzero(coarse.agrees) >= TUNING.followed_least else T_predicted


@dataclass(frozen=True, eq=False)
class _CoarsePose:
    """A rough pose, and which of the followed features agree with it (n)."""

    T_camera_map: Array
    agrees: Mask


@dataclass(frozen=True, eq=False)
class _Followed:
    """Landmarks by their `rows` (n), followed to `uv` (n x 2 px) and `rays` (n x 3, the last NaN) where `found` (n)."""

    rows: Index
    points: Array
    covariances: Array
    uv: Array
    rays: Array
    found: Mask
    lens: Lens

    @classmethod
    def at(cls, landmarks: Landmarks, rows: Index, uv: Array, found: Mask, lens: Lens) -> "_Followed":
        """Return what was found of the landmarks `rows` at `uv`."""
        rays = np.full((len(rows), 3), np.nan)
        rays[:, :2] = rays_at(lens.rays, np.where(found[:, None], uv, 0.0))
        return cls(rows, landmarks.position[rows], landmarks.covariance[rows], uv, rays, found, lens)

    def features(self, landmarks: Landmarks, eye: Array) -> FollowedFeatures:
        """Return the found ones, seen from about `eye` (3, m, map frame)."""
        found = self.found
        return FollowedFeatures(
            self.points[found],
            eye,
            self.rays[found, :2],
            self.uv[found],
            landmarks.seen[self.rows[found]],
            TUNING.followed_sigma_px,
            1.0 / self.lens.intrinsics[0],
        )

    def fitted(self, T_start: Array, used: Mask, gates_px: tuple[float, ...]) -> _CoarsePose:
        """Return the pose of the features `used`, by gates that close one after the other."""
        T = T_start
        for gate_px in gates_px:
            fit = fit_pose(
                self.points, self.covariances, self.rays, self._variances(gate_px), T, used, cauchy=TUNING.coarse_cauchy
            )
            T = fit.T_camera_map
        chi2 = fit_pose(self.points, self.covariances, self.rays, self._variances(_GATES_PX[-1]), T, None, 0).chi2[:, 0]
        return _CoarsePose(T, self.found & (chi2 < TUNING.coarse_chi2))

    def _variances(self, sigma_px: float) -> Array:
        fx, fy = self.lens.intrinsics[:2].tolist()
        out = np.empty((len(self.points), 4))
        out[:] = (sigma_px / fx) ** 2, 0.0, (sigma_px / fy) ** 2, 1.0
        return out


def _followed_before(landmarks: Landmarks, state: FrameState) -> tuple[Index, Array]:
    """Return the rows (n) of landmarks that the frame of `state` saw, as many as are followed, and where (n x 2 px)."""
    alive = landmarks.alive[state.rows]
    rows, uv = state.rows[alive], state.uv[alive]
    if len(rows) > TUNING.followed:
        chosen = np.linspace(0, len(rows) - 1, TUNING.followed).astype(np.int64)
        rows, uv = rows[chosen], uv[chosen]
    return rows, uv


def _search(map_: Map, state: FrameState, images: FrameImages, T_predicted: Array, sensor: SensorModel) -> _Followed:
    """Look for what the frame of `state` saw in the half-size image, by patches, around where `T_predicted` puts it."""
    rows, _ = _followed_before(map_.landmarks, state)
    keyframes = np.unique(map_.landmarks.keyframe[rows])
    candidates = Candidates.all_of(rows, keyframes, motions_from(map_, keyframes, T_predicted))
    return _Followed.at(
        map_.landmarks, *find_coarsely(map_.landmarks, candidates, T_predicted, images, sensor), sensor.lens
    )


def _follow(landmarks: Landmarks, state: FrameState, images: FrameImages, T_predicted: Array, lens: Lens) -> _Followed:
    """Follow what the frame of `state` saw into the next `images`, from where `T_predicted` puts it."""
    rows, uv_previous = _followed_before(landmarks, state)
    height, width = images.full.shape
    seen = project(landmarks.position[rows], T_predicted, lens.intrinsics, lens.distortion, width, height, _BORDER_PX)
    guess = np.where(np.isnan(seen[:, :2]), uv_previous, seen[:, :2])
    uv, found = follow_features(state.view.images.full, images.full, uv_previous, guess)
    return _Followed.at(landmarks, rows, uv, found, lens)
