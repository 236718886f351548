"""A camera found again by descriptors: near the newest frame after a wide step, or at any place it has seen before."""

from dataclasses import replace

import numpy as np

from odom.backend.map.map import Map
from odom.backend.map.memory import recall_near
from odom.backend.tracking.frame_state import FrameState, MotionPrior, Tracked
from odom.backend.tracking.frame_tracker import FrameTracker
from odom.backend.tracking.motion_model import AT_REST, Motion
from odom.backend.tracking.quality import has_enough_inliers, is_known_place, is_plausible_motion
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.place_descriptor import Place, describe_place
from odom.frontend.features.view import View
from odom.frontend.matching.place_recognition import believable, match_places, recognise
from odom.geometry import se3
from odom.registration import register


def follow_wide_step(
    tracker: FrameTracker, state: FrameState | None, view: View, place: Place, sensor: SensorModel
) -> Tracked | None:
    """Return the frame that shows `place` tracked from where its descriptors put it relative to the newest frame.

    `state` is the newest frame with a pose. None where the two do not match, or where the camera could not have moved
    so.
    """
    if state is None or (since_s := state.since_s(view.steady_stamp)) <= 0.0:
        return None
    pairs = match_places(place, describe_place(state.view, sensor, state.twist))
    if pairs is None:
        return None
    registration = register(pairs)
    if not registration.ok:
        return None
    T_camera_map = se3.inverse(registration.T_target_source) @ state.T_camera_map
    prior = replace(state.motion_prior(since_s, sensor.noise.covariance_scale), expected=None)
    tracked = tracker.track_twice(view, sensor, T_camera_map, prior.twist_to(T_camera_map), state.reference, prior)
    is_motion = is_plausible_motion(prior.twist_to(tracked.T_camera_map))
    away = se3.log(tracked.T_camera_map @ se3.inverse(T_camera_map))
    is_same = np.linalg.norm(away[:3]) < TUNING.wide_away_m and np.linalg.norm(away[3:]) < TUNING.wide_away_rad
    is_sure = is_known_place(tracked, must_agree_with_chain=True) or (is_same and believable(registration))
    return tracked if is_motion and is_sure and has_enough_inliers(tracked) else None


def relocalise(
    map_: Map, tracker: FrameTracker, state: FrameState | None, view: View, place: Place, sensor: SensorModel
) -> Tracked | None:
    """Return the frame that shows `place` tracked around the key frame that it is recognised to show, None without any.

    `state` is the newest frame with a pose: in its segment, the camera must have been able to get here since.
    """
    for recognition in recognise(map_.places, place, set()):
        if recognition.refusal or recognition.registration is None:
            continue
        keyframe = map_.keyframes[recognition.candidate]
        T_camera_map = se3.inverse(recognition.registration.T_target_source) @ keyframe.T_camera_map
        recall_near(map_, keyframe.number, T_camera_map)
        motion = Motion.of(se3.inverse(T_camera_map), TUNING.place_sigma**2 * np.eye(6))
        prior = MotionPrior(motion, 0.0, sensor.noise.covariance_scale)
        tracked = tracker.track_twice(view, sensor, T_camera_map, AT_REST, keyframe.number, prior)
        if is_known_place(tracked) and (state is None or _is_within_reach(map_, state, tracked, view)):
            return tracked
    return None


def _is_within_reach(map_: Map, state: FrameState, tracked: Tracked, view: View) -> bool:
    """Return whether the camera could have moved from `state` to the tracked pose; other segments are always open."""
    since_s = state.since_s(view.steady_stamp)
    if since_s <= 0.0 or map_.keyframes[state.reference].segment != map_.keyframes[tracked.reference].segment:
        return True
    return is_plausible_motion(-state.step_to(tracked) / since_s)
