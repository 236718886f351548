"""The change to a better lens, between two frames: afterwards nothing is left that the old lens has measured.

The mapper has adjusted the map to the new lens in the background, and has converted key frames, landmarks, places and
the frames between (see `Mapper`). Here follows what the newest frame hands to the next: it is tracked again through the
new lens, as the next one will be, or the pose would jump between the two. Recent views need nothing: they are images,
measured when they are looked at. Waiting loop candidates are dropped.
"""

from dataclasses import replace

from odom.backend.odometry.frame_stages import FrameStages
from odom.backend.tracking.posed_frame import PosedFrame
from odom.backend.tracking.quality import has_enough_inliers, is_same_view
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.lens_change import LensChange
from odom.geometry.arrays import Array


def go_on_with_new_lens(
    stages: FrameStages, before: SensorModel, last: PosedFrame, T_reference_camera: Array
) -> PosedFrame:
    """Continue with the sensor's new lens in the map adjusted to it; return the newest frame there.

    `before` was the sensor until now; `last` is the newest frame, at `T_reference_camera`, in the map as it was.
    The pose in odom stays what it was.
    """
    change = LensChange(before.lens, stages.sensor.lens)
    timing_change = before.timing.change_to(stages.sensor.timing)
    stages.closer.drop_waiting()
    stages.chain.change_lens(change)
    moved = last.moved_with(stages.map, T_reference_camera)
    moved = moved.with_lens_changed(change, timing_change, stages.map.landmarks)
    moved = _tracked_again(stages, moved)
    stages.published.change_lens(moved.T_map_camera @ last.T_camera_map)
    return moved


def _tracked_again(stages: FrameStages, last: PosedFrame) -> PosedFrame:
    """Return the `last` frame tracked with the new lens, unchanged where too little is found.

    Through the old lens its rows had shown a wrong velocity, by which the measurements were carried to the middle row.
    Now they are carried by `last.twist`, and no velocity of the rows is handed on.
    """
    before, tracker, T = last.tracked, stages.tracker, last.T_camera_map
    if before is None:
        return last
    tracked = tracker.track(last.view, stages.sensor, T, last.twist, tracker.around(last.reference, T))
    if not (has_enough_inliers(tracked) and is_same_view(tracked, before)):
        return last
    tracked = replace(tracked, reference=before.reference)
    return replace(last, tracked=tracked, T_camera_map=tracked.T_camera_map)
