"""A camera found again by descriptors: near the newest frame after a wide step, or at any place it has seen before."""

from dataclasses import dataclass, replace

import numpy as np

from odom.backend.map.map import Map
from odom.backend.map.memory import recall_near
from odom.backend.tracking.expected_pose import MotionPrior
from odom.backend.tracking.frame_tracker import FrameTracker
from odom.backend.tracking.motion_model import AT_REST, Motion, is_plausible_motion, mean_twist
from odom.backend.tracking.posed_frame import PosedFrame
from odom.backend.tracking.quality import is_known_place
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.backend.tracking.tuning import TUNING
from odom.frame import Stamp
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.place_descriptor import Place, describe_place
from odom.frontend.features.view import View
from odom.frontend.matching.place_recognition import match_places, recognise
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.registration import Registration, register


def registered_step(last: PosedFrame, view: View, place: Place, sensor: SensorModel) -> Registration | None:
    """Return the registration (T_here_view) of a view that shows `place` with the newest frame, `last`.

    The two are matched by descriptors; None where they do not match.
    """
    if last.since_s(view.steady_stamp) <= 0.0:
        return None
    pairs = match_places(place, describe_place(last.view, sensor, last.twist))
    registration = None if pairs is None else register(pairs)
    return registration if registration is not None and registration.ok else None


def track_wide_step(
    tracker: FrameTracker, last: PosedFrame, view: View, registration: Registration, sensor: SensorModel
) -> TrackedFrame | None:
    """Return a view tracked from where its `registration` with the `last` frame puts it (see `registered_step`).

    None where too little of what is known there is found again, or where the camera could not have moved so.
    """
    T_camera_map = se3.inverse(registration.T_target_source) @ last.T_camera_map
    since_s = last.since_s(view.steady_stamp)
    prior = replace(last.motion_prior(since_s, sensor.noise.covariance_scale), expected_pose=None)
    twist = mean_twist(last.T_map_camera, T_camera_map, since_s)
    tracked = tracker.track_twice(view, sensor, T_camera_map, twist, last.reference, prior)
    is_motion = is_plausible_motion(mean_twist(last.T_map_camera, tracked.T_camera_map, since_s))
    return tracked if is_motion and agree(tracked, registration, T_camera_map) else None


def relocalise(
    map_: Map, tracker: FrameTracker, last: PosedFrame | None, view: View, place: Place, sensor: SensorModel
) -> TrackedFrame | None:
    """Return the frame that shows `place`, tracked around the key frame where that is recognised; None if nowhere.

    `last` is the newest frame with a pose: to a pose in its segment, the camera must have been able to move since.
    """
    for recognition in recognise(map_.places, place, set()):
        registration = recognition.registration
        if registration is None or not registration.ok:
            continue
        keyframe = map_.keyframes[recognition.candidate]
        T_camera_map = se3.inverse(registration.T_target_source) @ keyframe.T_camera_map
        recall_near(map_, keyframe.number, T_camera_map)
        if keyframe.number in map_.away:  # it cannot be read
            continue
        motion = Motion.of(se3.inverse(T_camera_map), TUNING.place_sigma**2 * np.eye(6))
        prior = MotionPrior(motion, 0.0, sensor.noise.covariance_scale)
        tracked = tracker.track_twice(view, sensor, T_camera_map, AT_REST, keyframe.number, prior)
        seen = None if last is None else _last_seen(map_, last, tracked.reference, view, sensor.clock.period_s)
        is_near = seen is not None and seen.is_near(tracked)
        is_soon = is_near and seen is not None and seen.is_soon
        is_known = not recognition.refusal and is_known_place(tracked, is_near)
        is_known = is_known or (is_soon and agree(tracked, registration, T_camera_map))
        if is_known and (last is None or _is_within_reach(map_, last, tracked, view)):
            return tracked
    return None


def agree(tracked: TrackedFrame, registration: Registration, T_registered: Array) -> bool:
    """Return whether landmarks confirm the T_camera_map `T_registered` that descriptors gave by `registration`.

    Landmarks and matches together must be many; fewer landmarks suffice where the two poses are close. That is enough
    only for a camera that cannot have gone far: elsewhere, other places may look alike.
    """
    away = se3.log(tracked.T_camera_map @ se3.inverse(T_registered))
    is_same = np.linalg.norm(away[:3]) < TUNING.wide_away_m and np.linalg.norm(away[3:]) < TUNING.wide_away_rad
    least = TUNING.least_inliers if is_same else TUNING.found_again
    evidence = tracked.found_again + int(registration.inliers.sum())
    return tracked.found_again >= least and evidence >= TUNING.share_with_matches * tracked.visible_count


def was_there_of_late(map_: Map, tracked: TrackedFrame, stamp: Stamp, period_s: float) -> bool:
    """Return whether a pose tracked at `stamp` is near the last key frame of its segment, made a few frames before.

    The segment is that of the pose's reference key frame; frames come every `period_s`.
    """
    seen = _last_keyframe(map_, map_.keyframes[tracked.reference].segment, stamp, period_s)
    return seen is not None and seen.is_near(tracked)


@dataclass(frozen=True, eq=False)
class _LastSeen:
    """Where a segment's last frame was, `T_camera_map`, and how many seconds ago; `is_soon`: few frames ago."""

    T_camera_map: Array
    since_s: float
    is_soon: bool

    def is_near(self, tracked: TrackedFrame) -> bool:
        """Return whether a tracked pose is no farther away than a camera goes in that time.

        That supports it as an agreeing chain would; after a long time it says nothing.
        """
        step = se3.log(tracked.T_camera_map @ se3.inverse(self.T_camera_map))
        likely_s = min(self.since_s, TUNING.near_s)
        away_m, away_rad = np.linalg.norm(step[:3]), np.linalg.norm(step[3:])
        return bool(away_m < TUNING.velocity_sigma_m_s * likely_s and away_rad < TUNING.velocity_sigma_rad_s * likely_s)


def _last_seen(map_: Map, last: PosedFrame, reference: int, view: View, period_s: float) -> _LastSeen | None:
    """Return the last frame in the segment of key frame `reference`; None if long ago, or if `view` is earlier."""
    segment = map_.keyframes[reference].segment
    if map_.keyframes[last.reference].segment == segment:
        since_s = last.since_s(view.steady_stamp)
        return _LastSeen(last.T_camera_map, since_s, since_s < _soon_s(period_s)) if since_s > 0.0 else None
    return _last_keyframe(map_, segment, view.stamp, period_s)


def _last_keyframe(map_: Map, segment: int, stamp: Stamp, period_s: float) -> _LastSeen | None:
    """Return the last key frame of a segment before `stamp`, None if that was long ago, or in an earlier session."""
    for keyframe in reversed(map_.keyframes):
        since_s = (stamp - keyframe.stamp) * 1e-9
        if since_s >= _soon_s(period_s) or keyframe.number < map_.earlier_keyframes:
            return None
        if keyframe.segment == segment and since_s > 0.0:
            return _LastSeen(keyframe.T_camera_map, since_s, True)
    return None


def _soon_s(period_s: float) -> float:
    return max(TUNING.near_s, TUNING.near_periods * period_s)


def _is_within_reach(map_: Map, last: PosedFrame, tracked: TrackedFrame, view: View) -> bool:
    """Return whether the camera could have moved from `last` to the tracked pose; other segments are always open."""
    since_s = last.since_s(view.steady_stamp)
    if since_s <= 0.0 or map_.keyframes[last.reference].segment != map_.keyframes[tracked.reference].segment:
        return True
    return is_plausible_motion(mean_twist(last.T_map_camera, tracked.T_camera_map, since_s))
