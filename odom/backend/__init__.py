"""Frames to trajectory: key frames, chaining, loop closure, graph. `Odometry.process(frame) -> Estimate`, no I/O."""

from typing import TYPE_CHECKING, Any

from odom.backend.estimate import ChainClosing as ChainClosing
from odom.backend.estimate import ChainPose as ChainPose
from odom.backend.estimate import ClosedChain as ClosedChain
from odom.backend.estimate import ClosingTest as ClosingTest
from odom.backend.estimate import Estimate as Estimate
from odom.backend.estimate import Features as Features
from odom.backend.estimate import LoopCandidate as LoopCandidate
from odom.backend.estimate import RelativePose as RelativePose
from odom.backend.estimate import State as State
from odom.backend.estimate import TrajectoryPose as TrajectoryPose
from odom.backend.settings import OdometrySettings as OdometrySettings

if TYPE_CHECKING:
    from odom.backend.odometry.odometry import Odometry as Odometry


def __getattr__(name: str) -> Any:
    """Import the odometry on first use: processes that only read estimates do not load the compiler."""
    if name == "Odometry":
        from odom.backend.odometry.odometry import Odometry

        return Odometry
    raise AttributeError(name)
