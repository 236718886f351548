"""A wide step: a frame that could not be followed is matched with the newest one by descriptors.

What the newest frame saw besides the map's landmarks is needed now, so it becomes a key frame after all: in doubt only
with what is known to stand, or descriptors would lead the camera from one body to the next.
"""

from odom.backend.mapping.keyframe_inserter import KeyframeInserter
from odom.backend.tracking.frame_tracker import FrameTracker
from odom.backend.tracking.posed_frame import PosedFrame
from odom.backend.tracking.relocalisation import registered_step, track_wide_step
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.place_descriptor import Place
from odom.frontend.features.view import View


def follow_wide_step(
    tracker: FrameTracker,
    inserter: KeyframeInserter,
    last: PosedFrame | None,
    view: View,
    place: Place,
    sensor: SensorModel,
    in_doubt: bool,
) -> tuple[PosedFrame | None, TrackedFrame | None]:
    """Return the `last` frame afterwards, and the frame that shows `place` tracked from there, or None."""
    registration = None if last is None else registered_step(last, view, place, sensor)
    if last is None or registration is None:
        return last, None
    last = inserter.ensure_keyframe(last, sensor, in_doubt)
    tracked = track_wide_step(tracker, last, view, registration, sensor)
    if tracked is not None:
        inserter.want_keyframe()
    return last, tracked
