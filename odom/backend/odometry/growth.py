"""What the map gains after a frame: the newest key frame's corners, and key frames of a saved map that are near."""

from dataclasses import replace

from odom.backend.odometry.frame_stages import FrameStages


def grow(stages: FrameStages, count: int | None) -> None:
    """Add to the map what is due after frame number `count` (None: after the last one; see `NewCorners`)."""
    found = stages.mapper.inserter.take_corners(count, stages.sensor)
    if found is not None and stages.state is not None:
        view, tracked = found.search.compared.view, found.search.compared.tracked
        landmarks = stages.map.landmarks
        stages.moving = stages.moving.after_keyframe(view.steady_stamp, found.moved_share, tracked, landmarks)
        if stages.state.view is view:
            keyframe = stages.map.keyframes[found.search.keyframe]
            stages.state = replace(stages.state, rows=keyframe.rows, uv=keyframe.uv)
    if stages.state is not None and count is not None:
        stages.mapper.recall(stages.state)
