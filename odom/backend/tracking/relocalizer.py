"""A camera found again by descriptors: near the newest frame after a wide step, or at any place it has seen before."""

from dataclasses import replace

import numpy as np

from odom.backend.map.map import Map
from odom.backend.map.memory import recall_near
from odom.backend.tracking.frame_state import FrameState, MotionPrior, Tracked
from odom.backend.tracking.frame_tracker import FrameTracker
from odom.backend.tracking.motion_model import AT_REST, Motion
from odom.backend.tracking.quality import is_known_place, is_plausible_motion
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.place_descriptor import Place, describe_place
from odom.frontend.features.view import View
from odom.frontend.matching.place_recognition import believable, match_places, recognise
from odom.geometry import se3
from odom.registration import Registration, register


def registered_step(state: FrameState, view: View, place: Place, sensor: SensorModel) -> Registration | None:
    """Return T_here_view of a view that shows `place`, matched by descriptors with the newest frame, that of `state`.

    None where the two do not match.
    """
    if state.since_s(view.steady_stamp) <= 0.0:
        return None
    pairs = match_places(place, describe_place(state.view, sensor, state.twist))
    registration = None if pairs is None else register(pairs)
    return registration if registration is not None and registration.ok else None


def track_wide_step(
    tracker: FrameTracker, state: FrameState, view: View, registration: Registration, sensor: SensorModel
) -> Tracked | None:
    """Return a view tracked from where its `registration` with the frame of `state` puts it (see `registered_step`).

    None where too little of what is known there is found again, or where the camera could not have moved so.
    """
    T_camera_map = se3.inverse(registration.T_target_source) @ state.T_camera_map
    prior = state.motion_prior(state.since_s(view.steady_stamp), sensor.noise.covariance_scale)
    prior = replace(prior, expected=None)
    tracked = tracker.track_twice(view, sensor, T_camera_map, prior.twist_to(T_camera_map), state.reference, prior)
    is_motion = is_plausible_motion(prior.twist_to(tracked.T_camera_map))
    away = se3.log(tracked.T_camera_map @ se3.inverse(T_camera_map))
    is_same = np.linalg.norm(away[:3]) < TUNING.wide_away_m and np.linalg.norm(away[3:]) < TUNING.wide_away_rad
    least = TUNING.least_inliers if is_same and believable(registration) else TUNING.found_again
    return tracked if is_motion and tracked.found_again >= least else None


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
        is_near = state is not None and _is_near(map_, state, tracked, view)
        if is_known_place(tracked, is_near) and (state is None or _is_within_reach(map_, state, tracked, view)):
            return tracked
    return None


def _is_near(map_: Map, state: FrameState, tracked: Tracked, view: View) -> bool:
    """Return whether the tracked pose is no farther from the newest one, of `state`, than a camera goes in that time.

    That speaks for it as a chain does; after long it says nothing.
    """
    since_s = state.since_s(view.steady_stamp)
    if map_.keyframes[state.reference].segment != map_.keyframes[tracked.reference].segment or since_s <= 0.0:
        return False
    step, likely_s = state.step_to(tracked), min(since_s, TUNING.near_s)
    away_m, away_rad = np.linalg.norm(step[:3]), np.linalg.norm(step[3:])
    return bool(away_m < TUNING.velocity_sigma_m_s * likely_s and away_rad < TUNING.velocity_sigma_rad_s * likely_s)


def _is_within_reach(map_: Map, state: FrameState, tracked: Tracked, view: View) -> bool:
    """Return whether the camera could have moved from `state` to the tracked pose; other segments are always open."""
    since_s = state.since_s(view.steady_stamp)
    if since_s <= 0.0 or map_.keyframes[state.reference].segment != map_.keyframes[tracked.reference].segment:
        return True
    return is_plausible_motion(-state.step_to(tracked) / since_s)
