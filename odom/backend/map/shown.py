"""What is shown of a map: the path of its key frames, and its landmarks; of large ones as much as eyes tell apart."""

import numpy as np

from odom.backend.estimate import TrajectoryPose
from odom.backend.map.map import Map
from odom.backend.map.moved_keyframes import changes_in_map
from odom.frame import Stamp
from odom.geometry.arrays import Array

_MOST_CLOUD_POINTS = 20_000
"""Points of the published cloud of landmarks (240 kB a message): more are not told apart on a screen."""
_MOST_FAR_IN_PATH = 500
"""Key frames in the published path that are not in memory: more take a millisecond of each key frame."""
_MOST_PUT_OFF = 5
"""Frames in a row that may have no time to show the path: more, and it lags behind a camera that turns fast."""

_Shown = tuple[Array, Array, TrajectoryPose]
"""T_camera_map and T_middle_stamp of a key frame, the very arrays, and the pose that is shown of it."""
_NOTHING: _Shown = (np.eye(4), np.eye(4), TrajectoryPose(Stamp(0), None, -1))


class ShownPath:
    """The key frames' poses at their stamps; of those not in memory at most 500, thinned evenly.

    Poses that are where they were last time are not worked out again: most of a large map stays where it is. Being
    in several paths, they are read-only. Of the key frames not in memory those are shown whose number a power of two
    divides, the same ones while the camera goes on.
    """

    def __init__(self) -> None:
        self._known: dict[int, _Shown] = {}
        self._put_off = 0

    def is_due(self, is_other: bool, has_time: bool) -> bool:
        """Return whether to show the path after a frame; `is_other`: the frame changed it.

        It is put off for a few frames, until one has time.
        """
        self._put_off += bool(is_other or self._put_off)
        is_due = self._put_off > 0 and (has_time or self._put_off > _MOST_PUT_OFF)
        self._put_off = 0 if is_due else self._put_off
        return is_due

    def of(self, map_: Map) -> tuple[TrajectoryPose, ...]:
        """Return the path of a map, which must be the same at each call."""
        keyframes, known, step, moved = map_.keyframes, self._known, 1, []
        while len(keyframes) - len(map_.remembered) > step * _MOST_FAR_IN_PATH:
            step *= 2
        numbers = sorted({*range(0, len(keyframes), step), *map_.remembered})
        for n in numbers:
            k, one = keyframes[n], known.get(n, _NOTHING)
            if one[0] is not k.T_camera_map or one[1] is not k.T_middle_stamp or one[2].segment != k.segment:
                moved.append(k)
        T_middle_stamp = np.array([k.T_middle_stamp for k in moved]).reshape(-1, 4, 4)
        T_map_stamp = changes_in_map(T_middle_stamp, np.array([k.T_camera_map for k in moved]).reshape(-1, 4, 4))
        T_map_stamp.flags.writeable = False
        for k, T in zip(moved, T_map_stamp, strict=True):
            known[k.number] = k.T_camera_map, k.T_middle_stamp, TrajectoryPose(k.stamp, T, k.segment)
        self._known = {n: known[n] for n in numbers}
        return tuple([pose for _, _, pose in self._known.values()])


def cloud_of(map_: Map) -> Array:
    """Return landmarks (n x 3, m, map frame) that were seen more than once, thinned evenly to at most 20,000.

    Those whose depth is not known yet are left out.
    """
    rows = np.flatnonzero(map_.landmarks.alive & (map_.landmarks.seen > 1))
    rows = rows[~map_.landmarks.is_vague(rows)]
    return np.asarray(map_.landmarks.position[rows[:: 1 + len(rows) // _MOST_CLOUD_POINTS]])
