"""The paper's chain in the 3-D view: a thin line of its own, and the closed chain once the source has ended."""

from collections.abc import Iterator

import numpy as np
import rerun as rr

from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.viewer import entities, palette
from odom.viewer.bounded_trajectory import BoundedTrajectory
from odom.viewer.entities import EntityUpdate, update
from odom.viewer.line_strips import CHAIN_PHASE, DASH, dashes, lines, strips_entity
from odom.viewer.settings import ViewerSettings
from odom.wire.codec import StampedPose


class ChainScene:
    """The chain as it comes, in bounded memory; nothing of it is drawn where the settings switch it off."""

    def __init__(self, settings: ViewerSettings) -> None:
        self.poses = BoundedTrajectory(settings.path_poses)
        self._is_on = settings.chain
        self._tail: list[Array] = []

    def pose(self, pose: StampedPose) -> Iterator[EntityUpdate]:
        """Take the chain's pose of a frame; yield its newest piece."""
        if self.poses.add(pose.stamp, pose.T_parent_child):
            self._tail.clear()
        self._tail.append(pose.T_parent_child[:3, 3])
        if self._is_on:
            yield strips_entity(f"{entities.CHAIN}/tail", pose.stamp, [np.array(self._tail)], palette.CHAIN)

    def closed(self, stamp: Stamp, poses: tuple[StampedPose, ...]) -> Iterator[EntityUpdate]:
        """Yield the closed chain (poses of some of its frames); an empty one clears it."""
        if self._is_on and len(poses) > 1:
            positions = np.array([pose.T_parent_child[:3, 3] for pose in poses], dtype=np.float32)
            yield strips_entity(entities.CHAIN_CLOSED, stamp, [positions], palette.CHAIN_CLOSED)
        elif self._is_on:
            yield update(entities.CHAIN_CLOSED, stamp, rr.Clear(recursive=False))

    def refresh(self, stamp: Stamp) -> Iterator[EntityUpdate]:
        """Yield the whole chain, as dashes: it lies on other lines for long."""
        self._tail = self._tail[-1:]
        chain = self.poses.trajectory()
        if self._is_on and len(chain) > 1:
            dashed = dashes(lines(chain.positions, self.poses.strips()), CHAIN_PHASE)
            yield strips_entity(entities.CHAIN, stamp, dashed, palette.CHAIN, DASH)
