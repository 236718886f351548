"""What changes the map between two frames: results of the background before a frame, new landmarks after it."""

from dataclasses import replace

from odom.backend.estimate import LoopCandidate
from odom.backend.odometry.frame_stages import FrameStages
from odom.backend.odometry.new_lens import go_on_with_new_lens
from odom.geometry import se3


def apply_background(stages: FrameStages, count: int | None) -> tuple[list[LoopCandidate], bool]:
    """Apply background results due at frame `count` (None: all); return judged loops, and whether the map moved.

    The newest frame's pose moves with the map; a loop closure leaves its pose in odom as it was.
    """
    last, before = stages.last, stages.sensor
    if last is None:
        return [], False
    T_reference_camera = last.T_reference_camera(stages.map)
    taken = stages.mapper.apply_background(count, before)
    stages.sensor, described = taken or (before, [])
    if stages.sensor.lens is not before.lens:
        last = go_on_with_new_lens(stages, before, last, T_reference_camera)
        T_reference_camera = last.T_reference_camera(stages.map)
    T_reference_adjusted = stages.map.keyframes[last.reference].T_camera_map
    loops = stages.closer.judge(described, stages.sensor)
    if stages.mapper.is_idle:  # what is being adjusted must not move meanwhile
        loops += stages.closer.close(count, stages.sensor)
    if is_closed := any(loop.accepted for loop in loops):
        T_reference_map = stages.map.keyframes[last.reference].T_camera_map
        stages.published.correct(se3.inverse(T_reference_map) @ T_reference_adjusted)
    if map_moved := is_closed or taken is not None:
        stages.last = last.moved_with(stages.map, T_reference_camera)
    return loops, map_moved


def insert_found_corners(stages: FrameStages, count: int | None) -> None:
    """Make landmarks of the newest key frame's corners if they are due after frame `count` (None: the last one).

    Near key frames of a saved map are brought back into memory.
    """
    found = stages.mapper.inserter.insert_found_corners(count, stages.sensor)
    if found is not None and stages.last is not None:
        view, tracked = found.search.compared.view, found.search.compared.tracked
        landmarks = stages.map.landmarks
        stages.moving = stages.moving.after_keyframe(view.steady_stamp, found.moved_share, tracked, landmarks)
        if stages.last.view is view:
            keyframe = stages.map.keyframes[found.search.keyframe]
            stages.last = replace(stages.last, rows=keyframe.rows, uv=keyframe.uv)
    if stages.last is not None and count is not None:
        stages.mapper.recall(stages.last)
