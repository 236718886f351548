"""Frames to trajectory: key frames, chaining, loop closure, graph. `Odometry.process(frame) -> Estimate`, no I/O."""

from odom.backend.estimate import Estimate, Features, LoopCandidate, RelativePose, State, TrajectoryPose

__all__ = ["Estimate", "Features", "LoopCandidate", "RelativePose", "State", "TrajectoryPose"]
