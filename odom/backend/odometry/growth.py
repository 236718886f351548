"""What the map gains after a frame: the newest key frame's corners, and key frames of a saved map that are near."""

from dataclasses import replace

from odom.backend.odometry.frame_stages import FrameStages


def grow(frames: FrameStages, count: int | None) -> None:
    """Add to the map what is due after frame number `count` (None: after the last one; see `NewCorners`)."""
    grown = frames.mapper.inserter.take_corners(count, frames.sensor)
    if grown is not None and frames.state is not None:
        view, tracked = grown.wanted.before.view, grown.wanted.before.tracked
        landmarks = frames.map.landmarks
        frames.moving = frames.moving.after_keyframe(view.steady_stamp, grown.moved_share, tracked, landmarks)
        if frames.state.view is view:
            keyframe = frames.map.keyframes[grown.wanted.keyframe]
            frames.state = replace(frames.state, rows=keyframe.rows, uv=keyframe.uv)
    if frames.state is not None and count is not None:
        frames.mapper.recall(frames.state)
