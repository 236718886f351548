"""Frames to trajectory: key frames, chaining, loop closure, graph. `Odometry.process(frame) -> Estimate`, no I/O."""

from typing import TYPE_CHECKING, Any

from odom.backend.estimate import (
    ChainClosing,
    ChainPose,
    ClosedChain,
    ClosingTest,
    Estimate,
    Features,
    LoopCandidate,
    RelativePose,
    State,
    TrajectoryPose,
)
from odom.backend.settings import OdometrySettings

if TYPE_CHECKING:
    from odom.backend.odometry.odometry import Odometry

__all__ = [
    "ChainClosing",
    "ChainPose",
    "ClosedChain",
    "ClosingTest",
    "Estimate",
    "Features",
    "LoopCandidate",
    "Odometry",
    "OdometrySettings",
    "RelativePose",
    "State",
    "TrajectoryPose",
]


def __getattr__(name: str) -> Any:
    """Import the odometry on first use: processes that only read estimates do not load the compiler."""
    if name == "Odometry":
        from odom.backend.odometry.odometry import Odometry

        return Odometry
    raise AttributeError(name)
