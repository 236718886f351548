"""The 3-D view: trajectories, key frames with clouds and covariance, loop closures, truth."""

from collections import deque
from collections.abc import Iterator

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from odom.evaluation import Trajectory
from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.geometry.se3 import inverses
from odom.viewer import entities, palette
from odom.viewer.bounded_trajectory import BoundedTrajectory
from odom.viewer.claimed_covariances import ClaimedCovariances
from odom.viewer.ellipsoids import ellipsoids
from odom.viewer.entities import EntityUpdate, transform, update
from odom.viewer.keyframe_clouds import Cloud, KeyframeClouds
from odom.viewer.line_strips import DASH, ONLINE_PHASE, dashes, lines, strips_entity
from odom.viewer.settings import ViewerSettings
from odom.wire.codec import Loop, StampedPose

_MAX_GAP_S = 1.0
"""A key frame's causal pose is interpolated over at most this gap, which a thinned trajectory of hours has."""
_STANDS = 1e-3
"""A key frame that moves less (metres, or entries of its rotation) is not drawn again."""

_LOOP, _REFUSED, _POINT = -1.8, -0.4, -1.6
"""Radii of lines and points; Rerun reads negative ones as screen units, which stay as thick when one looks closer."""
_REFUSED_SHOWN = 60
"""Newest refused loops drawn: more make a web that hides the map."""


class MapScene:
    """What is known about the map; every collection is bounded by the settings."""

    def __init__(self, settings: ViewerSettings) -> None:
        self.online = BoundedTrajectory(settings.path_poses)
        self.clouds: KeyframeClouds[Cloud] = KeyframeClouds(settings.cloud_keyframes)
        self._most_loops = settings.loops
        self.claimed = ClaimedCovariances()
        self._paths: dict[str, tuple[StampedPose, ...]] = {}
        self._keyframes: tuple[StampedPose, ...] = ()
        self._part_of: dict[Stamp, str] = {}
        self._covariances: dict[Stamp, Array] = {}
        self._placed: dict[Stamp, tuple[Array, bool]] = {}
        self._seen_keyframe = Stamp(-(2**62))
        self._loops: deque[Loop] = deque()
        self._landmarks = np.zeros((0, 3), dtype=np.float32)
        self._online_tail: list[Array] = []
        self._corrected_tail: list[Array] = []

    def odometry(self, pose: StampedPose) -> Iterator[EntityUpdate]:
        """Take the causal pose of a frame; yield the newest piece of the online trajectory."""
        if self.online.add(pose.stamp, pose.T_parent_child):
            self._online_tail.clear()
            self._corrected_tail.clear()
        if pose.covariance is not None:
            self.claimed.add(pose.stamp, pose.covariance)
        self._online_tail.append(pose.T_parent_child[:3, 3])
        yield strips_entity(f"{entities.ONLINE}/tail", pose.stamp, [np.array(self._online_tail)], palette.ONLINE)

    def pose(self, pose: StampedPose) -> Iterator[EntityUpdate]:
        """Yield the camera and the newest piece of the corrected trajectory."""
        self._corrected_tail.append(pose.T_parent_child[:3, 3])
        yield update(entities.CAMERA, pose.stamp, transform(pose.T_parent_child))
        yield strips_entity(
            f"{entities.CORRECTED}/tail", pose.stamp, [np.array(self._corrected_tail)], palette.CORRECTED
        )

    def path(self, stamp: Stamp, poses: tuple[StampedPose, ...], part: str = "") -> Iterator[EntityUpdate]:
        """Take the corrected key frames of the part the camera is in, or of another `part`, never joined to it.

        Yields the clouds that waited for their places, and what has moved.
        """
        if part and not poses and part in self._paths:
            yield update(_part_entity(part), stamp, rr.Clear(recursive=True))
        self._paths = {name: path for name, path in {**self._paths, part: poses}.items() if path}
        placed = {pose.stamp: (pose, name) for name in sorted(self._paths, reverse=True) for pose in self._paths[name]}
        self._keyframes = tuple(placed[at][0] for at in sorted(placed))
        self._part_of = {at: name for at, (_, name) in placed.items()}
        for pose in self._keyframes:
            if pose.stamp > self._seen_keyframe:
                self._seen_keyframe = pose.stamp
                if (covariance := self.claimed.get(pose.stamp)) is not None:
                    self._covariances[pose.stamp] = covariance
        yield from self._clouds(stamp)

    def cloud(self, keyframe: Stamp, cloud: Cloud) -> Iterator[EntityUpdate]:
        """Take the cloud of a newer key frame; yield it once its place is known, and the removal of older ones."""
        if self.clouds.newest is not None and keyframe <= self.clouds.newest:
            return
        for gone in self.clouds.keep(keyframe, cloud):
            if self._placed.pop(gone, None) is not None:
                yield update(f"{entities.CLOUDS}/{gone}", keyframe, rr.Clear(recursive=False))
        yield from self._clouds(keyframe)

    def landmarks(self, stamp: Stamp, points: NDArray[np.float32]) -> Iterator[EntityUpdate]:
        """Yield the landmarks (n x 3, map)."""
        self._landmarks = points
        yield update(entities.LANDMARKS, stamp, rr.Points3D(points[:, :3], colors=palette.LANDMARK, radii=-1.2))

    def loop(self, loop: Loop) -> bool:
        """Take a loop candidate, which is drawn with the next `refresh`; False for one that is known already."""
        if loop in self._loops:
            return False
        self._loops.append(loop)
        if len(self._loops) > self._most_loops:
            self._loops.remove(next((old for old in self._loops if not old.accepted), self._loops[0]))
        return True

    def corrected(self) -> Trajectory:
        """Return every pose of the online trajectory with the correction of the key frame before it, in the map.

        Poses before the first key frame get its correction. Parts that were never joined are segments, 0 the one the
        camera is in.
        """
        online = self.online.trajectory()
        if not self._keyframes or not len(online):
            return online
        stamps = np.array([pose.stamp for pose in self._keyframes], dtype=np.int64)
        T_map = np.array([pose.T_parent_child for pose in self._keyframes])
        T_odom, valid = online.at(stamps, _MAX_GAP_S)
        if not valid.any():
            return trajectory(self._keyframes)
        correction = T_map[valid] @ inverses(T_odom[valid])
        before = np.clip(np.searchsorted(stamps[valid], online.stamps, side="right") - 1, 0, None)
        number = {name: i for i, name in enumerate(["", *self._others()])}
        part = np.array([number[self._part_of[pose.stamp]] for pose in self._keyframes])[valid][before]
        return Trajectory(online.stamps, correction[before] @ online.T_world_body, part if part.any() else None)

    def refresh(self, stamp: Stamp, corrected: Trajectory) -> Iterator[EntityUpdate]:
        """Yield the whole trajectories, key frames, ellipsoids and loops: what a browser opened now must see."""
        online, strips = self.online.trajectory(), self.online.strips()
        if not len(online):
            return
        self.claimed.keep(online.stamps)
        dashed = dashes(lines(online.positions, strips), ONLINE_PHASE)
        yield strips_entity(entities.ONLINE, stamp, dashed, palette.ONLINE, DASH)
        yield from self._parts(stamp, corrected, strips)
        self._covariances = {at: value for at, value in self._covariances.items() if at in self._part_of}
        self._online_tail, self._corrected_tail = self._online_tail[-1:], self._corrected_tail[-1:]
        if self._keyframes:
            positions = np.array([pose.T_parent_child[:3, 3] for pose in self._keyframes])
            colors = [palette.UNJOINED if self._part_of[pose.stamp] else palette.CORRECTED for pose in self._keyframes]
            yield update(entities.KEYFRAMES, stamp, rr.Points3D(positions, colors=colors, radii=-3.0))
            known = [pose for pose in self._keyframes if pose.stamp in self._covariances]
            yield from ellipsoids(stamp, known, [self._covariances[pose.stamp] for pose in known])
        yield from self._loop_lines(stamp, corrected)

    def _others(self) -> list[str]:
        """Return the names of the parts that the camera is not in."""
        return sorted(self._paths.keys() - {""})

    def _parts(self, stamp: Stamp, corrected: Trajectory, strips: NDArray[np.int64]) -> Iterator[EntityUpdate]:
        """Yield the corrected trajectory, parts that were never joined to the camera's own in another colour."""
        if len(strips) != len(corrected):
            strips = np.zeros(len(corrected), dtype=np.int64)
        part = np.zeros(len(corrected), dtype=np.int64) if corrected.segment is None else corrected.segment
        run = np.cumsum(np.diff(strips, prepend=strips[:1]).astype(bool) | np.diff(part, prepend=part[:1]).astype(bool))
        own = part == 0
        yield strips_entity(entities.CORRECTED, stamp, lines(corrected.positions[own], run[own]), palette.CORRECTED)
        for number, name in enumerate(self._others(), 1):
            chosen = part == number
            pieces = lines(corrected.positions[chosen], run[chosen])
            label = f"{name.replace('_', ' ')}: not joined"
            yield strips_entity(_part_entity(name), stamp, pieces, palette.UNJOINED, label=label)

    def _clouds(self, stamp: Stamp, again: bool = False) -> Iterator[EntityUpdate]:
        """Yield clouds that are new or have changed colour, and places that have moved; all of them if `again`."""
        for keyframe in self._keyframes:
            at = keyframe.stamp
            if at not in self.clouds:
                continue
            T, is_apart = keyframe.T_parent_child, bool(self._part_of[at])
            placed = None if again else self._placed.get(at)
            if placed is None or placed[1] != is_apart:
                cloud = self.clouds[at]
                colors = palette.tinted(cloud.colors, palette.UNJOINED) if is_apart else cloud.colors
                yield update(f"{entities.CLOUDS}/{at}", stamp, rr.Points3D(cloud.points, colors=colors, radii=_POINT))
            if placed is None or np.abs(placed[0] - T).max() >= _STANDS:
                yield update(f"{entities.CLOUDS}/{at}", stamp, transform(T))
            else:
                T = placed[0]
            self._placed[at] = T, is_apart

    def all_points(self, stamp: Stamp) -> Iterator[EntityUpdate]:
        """Yield the landmarks and every cloud again, with its place."""
        if len(self._landmarks):
            yield from self.landmarks(stamp, self._landmarks)
        yield from self._clouds(stamp, again=True)

    def _loop_lines(self, stamp: Stamp, corrected: Trajectory) -> Iterator[EntityUpdate]:
        if not self._loops:
            return
        ends = [
            corrected.at(np.array([getattr(loop, end) for loop in self._loops], dtype=np.int64), _MAX_GAP_S)
            for end in ("candidate_stamp", "stamp")
        ]
        both = ends[0][1] & ends[1][1]
        accepted = np.array([loop.accepted for loop in self._loops])
        segments = np.stack([ends[0][0][:, :3, 3], ends[1][0][:, :3, 3]], axis=1).astype(np.float32)
        for path, shown, color, radius in (
            (entities.LOOPS_ACCEPTED, segments[both & accepted], palette.LOOP_ACCEPTED, _LOOP),
            (entities.LOOPS_REFUSED, segments[both & ~accepted][-_REFUSED_SHOWN:], palette.LOOP_REFUSED, _REFUSED),
        ):
            if len(shown):
                yield strips_entity(path, stamp, shown, color, radius)


def trajectory(poses: tuple[StampedPose, ...]) -> Trajectory:
    """Return the poses as a trajectory; one that is not newer than all before it is left out."""
    stamps = np.array([pose.stamp for pose in poses], dtype=np.int64)
    newer = np.ones(len(stamps), dtype=bool)
    newer[1:] = stamps[1:] > np.maximum.accumulate(stamps)[:-1]
    return Trajectory(stamps[newer], np.array([pose.T_parent_child for pose in poses])[newer])


def _part_entity(part: str) -> str:
    return f"{entities.UNJOINED}/{part}"
