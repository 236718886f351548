"""A frame's pose from its colour image alone: by constant velocity, improved by optical flow from the frame before."""

from dataclasses import dataclass

import numpy as np

from odom.backend.map.landmarks import Landmarks
from odom.backend.map.map import Map
from odom.backend.tracking.consensus import consensus
from odom.backend.tracking.found_landmarks import those_that_count
from odom.backend.tracking.keyframe_poses import keyframe_poses
from odom.backend.tracking.pose_solver import chi2_of, fit_pose
from odom.backend.tracking.posed_frame import PosedFrame
from odom.backend.tracking.tuning import TUNING
from odom.backend.tracking.voting_features import VotingFeatures, is_exact
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.images import FrameImages
from odom.frontend.features.shutter_compensation import middle_rays, seen_in_motion
from odom.frontend.matching.landmark_search import Candidates, find_coarsely
from odom.frontend.matching.optical_flow import follow_features
from odom.geometry.arrays import Array, Index, Mask
from odom.geometry.numbered import distinct

_BORDER_PX = 2.0
"""Followed features are predicted no closer to the image's border than this."""
_NEAREST_M = 0.1
"""Landmarks count as at least this far away, also those behind the camera."""
_GATES_PX = (TUNING.coarse_gate_px, TUNING.middle_gate_px, TUNING.last_gate_px)


def predict_pose(map_: Map, last: PosedFrame, images: FrameImages, stamp: SteadyStamp, sensor: SensorModel) -> Array:
    """Return T_camera_map of the `images` taken at `stamp`, after the `last` frame.

    As long as the camera moves about as it did, patches are found around where constant velocity puts them. Where it
    surprises, features are followed from the image before, however far they went: the fit's gate closes step by step
    (graduated non-convexity), so that a wrong constant velocity does no harm. Where many features disagree with the
    fit, the motion is chosen that most of the image shows; where too few are followed, constant velocity stands. Rays
    are carried to the middle row by the motion that leads to the pose in question.
    """
    since_s = last.since_s(stamp)
    T_predicted = last.predicted_after(since_s)
    landmarks = map_.landmarks
    followed = _search(map_, last, images, T_predicted, since_s, sensor)
    coarse = followed.fitted(T_predicted, followed.found, _GATES_PX[1:])
    least = max(TUNING.followed_least, TUNING.unsurprised_share * len(followed.rows))
    features = followed.features(landmarks, coarse.rays)
    is_contested = features.is_contested(coarse.T_camera_map, ~coarse.agrees[followed.found])
    if np.count_nonzero(coarse.agrees) < least or is_contested:
        followed = _follow(landmarks, last, images, T_predicted, since_s, sensor)
        coarse = followed.fitted(T_predicted, followed.found, _GATES_PX)
        features = followed.features(landmarks, coarse.rays)
        is_contested = features.is_contested(coarse.T_camera_map, ~coarse.agrees[followed.found])
    rival = None
    if is_contested:
        rival = consensus(features, coarse.T_camera_map, last.expected_after(since_s))
    elif is_exact(features, coarse.T_camera_map, coarse.rays_before[followed.found, :2], T_predicted):
        rival = T_predicted
    if rival is not None:
        members = followed.fitted(rival, followed.found, ()).agrees
        coarse = followed.fitted(rival, members, _GATES_PX[-1:])
    return coarse.T_camera_map if np.count_nonzero(coarse.agrees) >= TUNING.followed_least else T_predicted


@dataclass(frozen=True, eq=False)
class _CoarsePose:
    """A rough pose, the followed features' `rays` (n x 3, as `in_motion` to it), and which of them agree with it (n).

    `rays_before` (n x 3) are those in motion to the pose where the fit began.
    """

    T_camera_map: Array
    rays_before: Array
    rays: Array
    agrees: Mask


@dataclass(frozen=True, eq=False)
class _Followed:
    """Landmarks `rows` (n) of the `last` frame, followed to `uv` (n x 2 px) in an image `since_s` later.

    `found` (n) says which were found there; `points` (n x 3, m, map frame) with `covariances` (n x 3 x 3, m^2) are
    their positions.
    """

    last: PosedFrame
    since_s: float
    sensor: SensorModel
    rows: Index
    points: Array
    covariances: Array
    uv: Array
    found: Mask

    @classmethod
    def at(
        cls,
        landmarks: Landmarks,
        last: PosedFrame,
        since_s: float,
        sensor: SensorModel,
        found: tuple[Index, Array, Mask],
    ) -> "_Followed":
        """Return the landmarks `found`: their rows (n), where they are (n x 2 px), and which were found (n)."""
        rows, uv, is_found = found
        uv = np.where(is_found[:, None], uv, 0.0)
        return cls(
            last,
            since_s,
            sensor,
            rows,
            landmarks.position.take(rows, 0),
            landmarks.covariance.take(rows, 0),
            uv,
            is_found,
        )

    def in_motion(self, T_camera_map: Array) -> Array:
        """Return the rays (n x 3, 1/z is NaN), carried to the middle row, if the camera moved straight to a pose."""
        inverse_depth = 1.0 / np.maximum(self.points @ T_camera_map[2, :3] + T_camera_map[2, 3], _NEAREST_M)
        twist, readout_s = self.last.twist_to(T_camera_map, self.since_s), self.sensor.timing.readout_s
        rays = np.full((len(self.rows), 3), np.nan)
        rays[:, :2] = middle_rays(self.sensor.lens.rays, self.uv, inverse_depth, twist, readout_s)
        return rays

    def features(self, landmarks: Landmarks, rays: Array) -> VotingFeatures:
        """Return those that were found, with their `rays` (n x 3, as `in_motion` to a pose)."""
        found = np.flatnonzero(self.found)
        return VotingFeatures(
            self.points.take(found, 0),
            self.last.T_map_camera[:3, 3],
            rays[:, :2].take(found, 0),
            self.uv.take(found, 0),
            landmarks.seen.take(self.rows.take(found)),
            TUNING.followed_sigma_px,
            1.0 / self.sensor.lens.intrinsics[0],
        )

    def fitted(self, T_start: Array, used: Mask, gates_px: tuple[float, ...]) -> _CoarsePose:
        """Return the pose fitted to the features `used`, with one gate after the other, each narrower."""
        T, rays = T_start, self.in_motion(T_start)
        rays_before = rays
        for gate_px in gates_px:
            variances = self._variances(gate_px)
            fit = fit_pose(self.points, self.covariances, rays, variances, T, used, cauchy=TUNING.coarse_cauchy)
            T = fit.T_camera_map
            rays = self.in_motion(T)
        chi2 = chi2_of(self.points, self.covariances, rays, self._variances(_GATES_PX[-1]), T)[:, 0]
        return _CoarsePose(T, rays_before, rays, self.found & (chi2 < TUNING.coarse_chi2))

    def _variances(self, sigma_px: float) -> Array:
        fx, fy = self.sensor.lens.intrinsics[:2].tolist()
        out = np.empty((len(self.points), 4))
        out[:] = (sigma_px / fx) ** 2, 0.0, (sigma_px / fy) ** 2, 1.0
        return out


def _followed_before(landmarks: Landmarks, last: PosedFrame) -> tuple[Index, Array]:
    """Return the rows (n) of landmarks that the `last` frame saw, as many as are followed, and where (n x 2 px)."""
    alive = landmarks.alive[last.rows]
    rows, uv = last.rows[alive], last.uv[alive]
    counts = those_that_count(landmarks.is_vague(rows))
    if not counts.all():
        rows, uv = rows[counts], uv[counts]
    if len(rows) > TUNING.followed:
        chosen = np.linspace(0, len(rows) - 1, TUNING.followed).astype(np.int64)
        rows, uv = rows.take(chosen), uv.take(chosen, 0)
    return rows, uv


def _search(
    map_: Map, last: PosedFrame, images: FrameImages, T_predicted: Array, since_s: float, sensor: SensorModel
) -> _Followed:
    """Look for what the `last` frame saw in the half-size image, by patches, around where `T_predicted` puts it."""
    landmarks = map_.landmarks
    rows, _ = _followed_before(landmarks, last)
    keyframes = distinct(landmarks.keyframe[rows])
    candidates = Candidates.all_of(rows, keyframes, keyframe_poses(map_, keyframes, T_predicted))
    twist = last.twist_to(T_predicted, since_s)
    found = find_coarsely(landmarks.patches, candidates, T_predicted, twist, images, sensor)
    return _Followed.at(landmarks, last, since_s, sensor, found)


def _follow(
    landmarks: Landmarks,
    last: PosedFrame,
    images: FrameImages,
    T_predicted: Array,
    since_s: float,
    sensor: SensorModel,
) -> _Followed:
    """Follow what the `last` frame saw into the next `images`, from where `T_predicted` puts it."""
    rows, uv_previous = _followed_before(landmarks, last)
    position, twist, readout_s = landmarks.position[rows], last.twist_to(T_predicted, since_s), sensor.timing.readout_s
    seen = seen_in_motion(position, T_predicted, sensor.lens, twist, readout_s, _BORDER_PX)
    guess = np.where(np.isnan(seen[:, :2]), uv_previous, seen[:, :2])
    uv, found = follow_features(last.view.images.full, images.full, uv_previous, guess, images.scale)
    return _Followed.at(landmarks, last, since_s, sensor, (rows, uv, found))
