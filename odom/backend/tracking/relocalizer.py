"""A lost camera found again: recognised by the place it sees, then tracked against what is known there."""

import numpy as np

from odom.backend.map.map import Map
from odom.backend.tracking.frame_state import FrameState, MotionPrior, Tracked
from odom.backend.tracking.frame_tracker import FrameTracker
from odom.backend.tracking.motion_model import AT_REST, Motion
from odom.backend.tracking.quality import is_known_place, is_plausible_motion
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.place_descriptor import describe_place
from odom.frontend.features.view import View
from odom.frontend.matching.place_recognition import recognise
from odom.geometry import se3


def relocalise(
    map_: Map, tracker: FrameTracker, state: FrameState | None, view: View, sensor: SensorModel
) -> tuple[Tracked | None, int]:
    """Return a frame tracked around the key frame that it is recognised to show, None without any.

    `state` is the newest frame with a pose: in its segment, the camera must have been able to get here since. The
    second value is how many features with depth the frame shows.
    """
    place = describe_place(view, sensor, AT_REST)
    for recognition in recognise(map_.places, place, set()):
        if recognition.refusal or recognition.registration is None:
            continue
        keyframe = map_.keyframes[recognition.candidate]
        T_camera_map = se3.inverse(recognition.registration.T_target_source) @ keyframe.T_camera_map
        motion = Motion.of(se3.inverse(T_camera_map), TUNING.place_sigma**2 * np.eye(6))
        prior = MotionPrior(motion, 0.0, sensor.noise.covariance_scale)
        local = tracker.around(keyframe.number, T_camera_map)
        tracked = tracker.track(view, sensor, T_camera_map, AT_REST, local, prior)
        if is_known_place(tracked) and (state is None or _is_within_reach(map_, state, tracked, view)):
            return tracked, len(place.points)
    return None, len(place.points)


def _is_within_reach(map_: Map, state: FrameState, tracked: Tracked, view: View) -> bool:
    """Return whether the camera could have moved from `state` to the tracked pose; other segments are always open."""
    since_s = state.since_s(view.steady_stamp)
    if since_s <= 0.0 or map_.keyframes[state.reference].segment != map_.keyframes[tracked.reference].segment:
        return True
    return is_plausible_motion(-state.step_to(tracked) / since_s)
