"""Constant transforms between frames, from tf_static."""

import numpy as np

from odom.geometry.arrays import Array
from odom.wire.codec import StampedPose

_MOST_FRAMES = 1000
"""Frames that are remembered: a robot has some hundred. A bound against a flood of invented ones."""


class StaticTransforms:
    """The tree of frames in tf_static."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Array]] = {}

    def take(self, transforms: tuple[StampedPose, ...]) -> None:
        """Remember transforms; a later one of a frame replaces the earlier."""
        for each in transforms:
            if each.child in self._parents or len(self._parents) < _MOST_FRAMES:
                self._parents[each.child] = (each.parent, each.T_parent_child)

    def between(self, target: str, source: str) -> Array | None:
        """Return `T_target_source` (4 x 4), None where nothing joins the two frames."""
        to_root = {name: self._path(name) for name in (target, source)}
        shared = next((name for name in to_root[source] if name in to_root[target]), None)
        if shared is None:
            return None
        return np.asarray(np.linalg.inv(to_root[target][shared]) @ to_root[source][shared])

    def _path(self, frame: str) -> dict[str, Array]:
        """Return the frame and those above it, each with `T_above_frame`."""
        path, T = {frame: np.eye(4)}, np.eye(4)
        while frame in self._parents:
            frame, T_parent_child = self._parents[frame]
            if frame in path:
                break
            T = T_parent_child @ T
            path[frame] = T
        return path
