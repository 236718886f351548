"""What is shown of a map: the path of its key frames, and its landmarks; of large ones as much as eyes tell apart."""

import numpy as np

from odom.backend.estimate import TrajectoryPose
from odom.backend.map.carrying import changes_in_map
from odom.backend.map.map import Map
from odom.geometry.arrays import Array

_MOST_CLOUD_POINTS = 20_000
"""Points of the published cloud of landmarks (240 kB a message): more are not told apart on a screen."""
_MOST_FAR_IN_PATH = 500
"""Key frames in the published path that are not in memory: more take a millisecond of each key frame."""


def path_of(map_: Map) -> tuple[TrajectoryPose, ...]:
    """Return the key frames' poses at their stamps; of forgotten ones at most 500, thinned evenly."""
    far = sorted(map_.away.union(map_.forgotten))
    shown = [map_.keyframes[n] for n in sorted([*far[:: 1 + len(far) // _MOST_FAR_IN_PATH], *map_.remembered])]
    T_middle_stamp = np.array([k.T_middle_stamp for k in shown]).reshape(-1, 4, 4)
    T_map_stamp = changes_in_map(T_middle_stamp, np.array([k.T_camera_map for k in shown]).reshape(-1, 4, 4))
    return tuple(TrajectoryPose(k.stamp, T, k.segment) for k, T in zip(shown, T_map_stamp, strict=True))


def cloud_of(map_: Map) -> Array:
    """Return landmarks (n x 3, m, map frame) that were seen more than once, thinned evenly to at most 20,000."""
    rows = np.flatnonzero(map_.landmarks.alive & (map_.landmarks.seen > 1))
    return np.asarray(map_.landmarks.position[rows[:: 1 + len(rows) // _MOST_CLOUD_POINTS]])
