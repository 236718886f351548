"""A better lens taken up between two frames: one event, after which nothing is left that an old one has measured.

The mapper has adjusted the map by the new lens in the background, and has told key frames, landmarks, places and frames
between through it (see `Mapper`). What the newest frame hands to the next one follows here: it is looked at again, as
the next one will be, or the pose would jump between the two. Recent views need nothing: they are images, measured when
they are looked at. Loop candidates that wait are dropped.
"""

from dataclasses import replace

from odom.backend.odometry.frame_stages import FrameStages
from odom.backend.tracking.frame_state import FrameState
from odom.backend.tracking.quality import has_enough_inliers, is_same_view
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.lens_change import LensChange
from odom.geometry.arrays import Array


def go_on_through_lens(
    frames: FrameStages, before: SensorModel, state: FrameState, T_reference_camera: Array
) -> FrameState:
    """Go on through the sensor's new lens in the map adjusted by it; return the newest frame's state there.

    `before` was the sensor until now; `state` and `T_reference_camera` are the newest frame's in the map as it was.
    The pose in odom stays what it was.
    """
    change = LensChange(before.lens, frames.sensor.lens)
    timing_change = frames.sensor.timing.vector - before.timing.vector
    frames.closer.drop_waiting()
    frames.chain.see_through(change)
    moved = state.moved_with(frames.map, T_reference_camera)
    moved = moved.seen_through(change, timing_change, frames.map.landmarks)
    moved = _looked_at_again(frames, moved)
    frames.published.change_lens(moved.T_map_camera @ state.T_camera_map)
    frames.state = moved
    return moved


def _looked_at_again(frames: FrameStages, state: FrameState) -> FrameState:
    """Return the newest frame's state tracked by what is known now, as it is where too little is found.

    Its rows had shown a wrong velocity through the old lens, which had bent what was measured: that of its motion
    counts, and none is handed on.
    """
    before, tracker, T = state.tracked, frames.tracker, state.T_camera_map
    if before is None:
        return state
    tracked = tracker.track(state.view, frames.sensor, T, state.twist, tracker.around(state.reference, T))
    if not (has_enough_inliers(tracked) and is_same_view(tracked, before)):
        return state
    tracked = replace(tracked, reference=before.reference)
    return replace(state, tracked=tracked, T_camera_map=tracked.T_camera_map)
