"""What the map gains after a frame: the newest key frame's corners, and key frames of a saved map that are near."""

from dataclasses import replace

from odom.backend.odometry.frame_stages import FrameStages


def grow(stages: FrameStages, count: int | None) -> None:
    """Add to the map what is due after frame number `count` (None: after the last one; see `NewCorners`)."""
    grown = stages.mapper.inserter.take_corners(count, stages.sensor)
    if grown is not None and stages.state is not None:
        view, tracked = grown.wanted.before.view, grown.wanted.before.tracked
        landmarks = stages.map.landmarks
        stages.moving = stages.moving.after_keyframe(view.steady_stamp, grown.moved_share, tracked, landmarks)
        if stages.state.view is view:
            keyframe = stages.map.keyframes[grown.wanted.keyframe]
            stages.state = replace(stages.state, rows=keyframe.rows, uv=keyframe.uv)
    if stages.state is not None and count is not None:
        stages.mapper.recall(stages.state)
