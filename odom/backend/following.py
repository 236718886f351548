"""Where a frame is: followed from the one before, or from a place that it is recognised to show."""

import numpy as np
from numpy.typing import NDArray

from odom.backend.belief import is_carried, is_enough, is_known_place, is_same_view
from odom.backend.closing import recognise
from odom.backend.mapper import Mapper
from odom.backend.motion import Motion
from odom.backend.selfcheck import SelfCheck
from odom.backend.stopwatch import Stopwatch
from odom.backend.tracking import Before, Tracked, coarse_pose
from odom.backend.whereabouts import Whereabouts
from odom.frame import Stamp
from odom.frontend.images import FrameImages
from odom.frontend.places import Place
from odom.frontend.view import View
from odom.registration import se3

Array = NDArray[np.float64]

_NEAR = 0.1**2 * np.eye(6)
"""Covariance of where a place shows a camera to be, m^2 and rad^2: the landmarks tell better, and its velocity too."""


def follow_coarsely(was: Whereabouts, mapper: Mapper, images: FrameImages, stamp: Stamp) -> Array:
    """Return T_camera_map of the `images` of the steady `stamp`, followed from the previous ones."""
    T_predicted = se3.exp(-was.twist * was.since_s(stamp)) @ was.T_camera_map
    previous = was.previous
    alive = mapper.map.landmarks.alive[previous.rows]
    rows, uv = previous.rows[alive], previous.uv[alive]
    return coarse_pose(mapper.map, rows, uv, previous.view.images, images, mapper.lens, T_predicted)


def follow(
    was: Whereabouts,
    mapper: Mapper,
    check: SelfCheck,
    view: View,
    watch: Stopwatch,
    T_coarse: Array | None = None,
) -> Tracked | None:
    """Return a frame tracked on from the previous one, None where what is found cannot be it.

    `T_coarse` (T_camera_map) is where it has been followed to already. Of a segment's second frame the first one is
    measured anew, and it is tracked again.
    """
    stamp = view.frame.stamp
    before = was.before(was.since_s(stamp), check)

    def tracked_from(T_start: Array) -> Tracked | None:
        watch.lap("follow")
        tracked = mapper.track(view, T_start, before.twist_to(T_start), was.near, check.noise, before)
        watch.lap("find and fit")
        if not (is_carried(before.twist_to(tracked.T_camera_map)) and is_enough(tracked)):
            return None
        # the place must be the one seen before, not one that looks alike
        is_chained = is_same_view(tracked, was.previous.tracked) and not was.is_bridged
        return tracked if is_chained or is_known_place(tracked) else None

    tracked = tracked_from(follow_coarsely(was, mapper, view.images, stamp) if T_coarse is None else T_coarse)
    if tracked is None or was.previous.tracked is not None:
        return tracked
    # The motion to the second frame tells how the first one's rows are bent. The rows themselves can't: landmarks bent
    # in the first frame look straight in the second.
    mapper.remeasure(was.near, was.previous.view, before.twist_to(tracked.T_camera_map), check)
    return tracked_from(follow_coarsely(was, mapper, view.images, stamp))


def relocalise(was: Whereabouts | None, mapper: Mapper, check: SelfCheck, view: View, place: Place) -> Tracked | None:
    """Return a frame tracked from a key frame that it is recognised to show by its `place`, None without any.

    In the segment where it `was`, the camera must have been able to get there since.
    """
    still = np.zeros(6)
    for recognition in recognise(mapper.index, place, set()):
        if recognition.refusal or recognition.registration is None:
            continue
        keyframe = mapper.map.keyframes[recognition.candidate]
        T_camera_map = se3.inverse(recognition.registration.T_target_source) @ keyframe.T_camera_map
        before = Before(Motion.of(se3.inverse(T_camera_map), _NEAR), 0.0, check.scale)
        tracked = mapper.track(view, T_camera_map, still, keyframe.number, check.noise, before)
        if is_known_place(tracked) and (was is None or _is_within_reach(was, mapper, tracked, view.frame.stamp)):
            return tracked
    return None


def _is_within_reach(was: Whereabouts, mapper: Mapper, tracked: Tracked, stamp: Stamp) -> bool:
    dt = was.since_s(stamp)
    keyframes = mapper.map.keyframes
    if dt <= 0.0 or keyframes[was.near].segment != keyframes[tracked.reference].segment:
        return True
    return is_carried(-se3.log(tracked.T_camera_map @ se3.inverse(was.T_camera_map)) / dt)
