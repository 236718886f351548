"""One frame against the map: followed from the previous image, searched in key frames' patches, and fitted."""

from collections.abc import Collection

import numpy as np

from odom.backend.map.map import Map
from odom.backend.settings import OdometrySettings
from odom.backend.tracking.expected_pose import MotionPrior
from odom.backend.tracking.found_landmarks import FoundLandmarks
from odom.backend.tracking.keyframe_poses import keyframe_poses
from odom.backend.tracking.motion_model import is_plausible_motion, mean_twist
from odom.backend.tracking.posed_frame import PosedFrame
from odom.backend.tracking.quality import has_enough_inliers, is_known_place, is_same_view
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.view import View
from odom.frontend.matching.landmark_search import Candidates, find_landmarks
from odom.frontend.matching.line_of_sight import LineOfSight
from odom.geometry.arrays import Array, Index
from odom.geometry.numbered import distinct


class FrameTracker:
    """Tracks frames of one camera against `map_`, which it reads only."""

    def __init__(self, map_: Map, settings: OdometrySettings) -> None:
        self._map, self._settings = map_, settings

    def follow(
        self, last: PosedFrame, view: View, sensor: SensorModel, T_predicted: Array, twist: Array, in_doubt: bool
    ) -> TrackedFrame | None:
        """Return the frame tracked from `T_predicted` (T_camera_map), or None.

        It was taken in motion with `twist` (6, SI, camera frame). None where a carried camera cannot have moved so;
        where moving bodies leave the pose `in_doubt`, and too few landmarks support a motion with a jerk; or where the
        place may only look like the one that the frame before showed.
        """
        since_s = last.since_s(view.steady_stamp)
        prior = last.motion_prior(since_s, sensor.noise.covariance_scale)
        local = self.around(last.reference, T_predicted)
        tracked = self.track(view, sensor, T_predicted, twist, local, prior)
        mean = mean_twist(last.T_map_camera, tracked.T_camera_map, since_s)
        if not (is_plausible_motion(mean) and has_enough_inliers(tracked)):
            return None
        is_jerk = prior.expected_pose is not None and not prior.expected_pose.is_within_reach(tracked.T_camera_map)
        if in_doubt and is_jerk and tracked.found_again < TUNING.sure_share * tracked.visible_count:
            return None
        is_continuous = is_same_view(tracked, last.tracked) and not last.is_bridged
        return tracked if is_continuous or is_known_place(tracked) else None

    def around(self, reference: int, T_camera_map: Array, but: Collection[int] = frozenset()) -> Index:
        """Return the key frames around a pose near key frame `reference`, nearest first, without those in `but`."""
        return self._map.neighbours(reference, T_camera_map, self._settings.local_keyframes, but)

    def track(
        self,
        view: View,
        sensor: SensorModel,
        T_start: Array,
        twist: Array,
        local: Index,
        prior: MotionPrior | None = None,
    ) -> TrackedFrame:
        """Find the landmarks of the key frames `local` where `T_start` (T_camera_map) predicts them, and fit the pose.

        The camera moves roughly with `twist` (6, SI). The first of `local` is the reference: its landmarks come first
        where there are more than are looked for. With the motion `prior`, the velocity is measured from the image's
        rows, and the pose fitted once more to the features as that velocity carries them to the middle row: carried by
        the noisier `twist`, they would make the shutter seem faster than it is.
        """
        L, expected = self._map.landmarks, None if prior is None else prior.expected_pose
        candidates = self._candidates(local, T_start, is_recognition=expected is None)
        in_view = find_landmarks(
            L.patches, candidates, T_start, twist, view.images, sensor, self._settings.max_features
        )
        if view.may_move is not None:
            in_view = in_view.take(np.flatnonzero(view.stands(in_view.uv)))
        landmarks = FoundLandmarks.of(view, sensor, in_view, L)
        measured = landmarks.measured(twist)
        fit = landmarks.fit(measured, T_start)
        outliers, elsewhere, disputed_since = fit.chi2[:, 0] >= TUNING.inlier_chi2, in_view.rows[:0], None
        features = landmarks.features(measured, fit)
        if prior is not None and expected is not None and features.is_contested(fit.T_camera_map, outliers):
            disputed_since = view.steady_stamp if prior.disputed_since is None else prior.disputed_since
            followed = landmarks.found.rows[~outliers]
            landmarks, measured, T = landmarks.settled(measured, fit, features, expected)
            elsewhere = np.setdiff1d(followed, landmarks.found.rows, assume_unique=True)
            fit = landmarks.fit(measured, T)
        twist_covariance = None
        if prior is not None and not prior.are_bent:
            velocity = landmarks.velocity(measured, fit.T_camera_map, twist, prior)
            twist, twist_covariance = velocity.twist, velocity.covariance
            measured = landmarks.measured(twist)
            fit = landmarks.fit(measured, fit.T_camera_map)
        found = landmarks.found
        inliers = fit.chi2[:, 0] < TUNING.inlier_chi2
        missed = found.missed(inliers)
        return TrackedFrame(
            T_camera_map=fit.T_camera_map,
            information=fit.information,
            rows=found.rows,
            uv=found.uv,
            measurements=measured,
            chi2=fit.chi2,
            inliers=inliers,
            looked_for=found.looked_for,
            missed=missed,
            elsewhere=elsewhere,
            sight=LineOfSight.to(L.position[missed], L.covariance[missed], fit.T_camera_map, view, sensor),
            reference=int(local[0]),
            twist=twist,
            twist_covariance=twist_covariance,
            disputed_since=disputed_since,
        )

    def track_twice(
        self,
        view: View,
        sensor: SensorModel,
        T_start: Array,
        twist: Array,
        near: int,
        prior: MotionPrior | None = None,
        but: Collection[int] = frozenset(),
    ) -> TrackedFrame:
        """Track a frame from a rough `T_start` near key frame `near`, and again from there, without those in `but`.

        Descriptors give a pose to some degrees only: more pixels than patches can be moved by.
        """
        T = self.track(view, sensor, T_start, twist, self.around(near, T_start, but), prior).T_camera_map
        return self.track(view, sensor, T, twist, self.around(near, T, but), prior)

    def _candidates(self, local: Index, T_camera_map: Array, is_recognition: bool) -> Candidates:
        """Return the landmarks of the key frames `local`, of which the first is the reference.

        Those that may be gone are looked for in any case, whichever key frame of the segment has seen them; those that
        have departed are not, where a place is to be recognised.
        """
        L, all_keyframes = self._map.landmarks, self._map.keyframes
        is_local = np.zeros(len(all_keyframes), dtype=np.bool_)
        is_local[local] = True
        segment = all_keyframes[int(local[0])].segment
        is_doubted = L.gone_s > 0.0
        doubted = np.flatnonzero(L.alive & is_doubted)
        keyframe = L.keyframe.take(doubted)
        is_near = np.zeros_like(is_local)
        is_near[[k for k in distinct(keyframe).tolist() if all_keyframes[k].segment == segment]] = True
        is_looked_for = L.alive & is_local.take(L.keyframe)
        is_looked_for[doubted[is_near.take(keyframe)]] = True
        if is_recognition:
            is_looked_for &= ~L.departed
        rows = np.flatnonzero(is_looked_for)
        keyframe, seen = L.keyframe.take(rows), L.seen.take(rows)
        keyframes = distinct(np.concatenate([local, keyframe]))
        chance = (seen + 1.0) / (L.tried.take(rows) + 2.0)  # Laplace's rule of succession
        priority = chance**2 * (seen + TUNING.reference_rank * (keyframe == int(local[0])))
        T_camera_keyframe = keyframe_poses(self._map, keyframes, T_camera_map)
        return Candidates(rows, priority, chance, is_doubted.take(rows), keyframes, T_camera_keyframe)
