"""The 3-D view: trajectories, key frames with clouds and covariance, loop closures, truth."""

from collections import OrderedDict, deque
from collections.abc import Iterator

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from odom.evaluation import Trajectory
from odom.evaluation.trajectory import inverse_all
from odom.frame import Stamp
from odom.viewer import entities, palette
from odom.viewer.clouds import Cloud, KeyframeClouds
from odom.viewer.draw import Draw, draw, transform
from odom.viewer.settings import ViewerSettings
from odom.viewer.trail import Trail, dashes, lines
from odom.wire.codec import Loop, StampedPose

Array = NDArray[np.float64]

_GAP_NS = 300_000_000
_MAX_GAP_S = 1.0
_RECENT = 900
_ELLIPSOIDS = 150
_STANDS = 1e-3
"""A key frame that moves less (metres, or entries of its rotation) is not drawn again."""

_LINE, _DASH = -1.2, -2.2
_ONLINE_PHASE, _TRUTH_PHASE = 0, 1
_LOOP, _REFUSED, _POINT = -1.8, -0.4, -1.6
_REFUSED_SHOWN = 60


class MapScene:
    """What is known about the map; every collection is bounded by the settings."""

    def __init__(self, settings: ViewerSettings) -> None:
        self.online = Trail(settings.path_poses)
        self.clouds: KeyframeClouds[Cloud] = KeyframeClouds(settings.cloud_keyframes)
        self._limit_loops = settings.loops
        self._recent: OrderedDict[Stamp, Array] = OrderedDict()
        self._keyframes: tuple[StampedPose, ...] = ()
        self._covariances: dict[Stamp, Array] = {}
        self._placed: dict[Stamp, Array] = {}
        self._seen_keyframe = Stamp(-(2**62))
        self._loops: deque[Loop] = deque()
        self._landmarks = np.zeros((0, 3), dtype=np.float32)
        self._online_tail: list[Array] = []
        self._corrected_tail: list[Array] = []

    def setup(self) -> Iterator[Draw]:
        """Yield what never changes."""
        yield draw(entities.WORLD, None, rr.ViewCoordinates.RDF)

    def odometry(self, pose: StampedPose) -> Iterator[Draw]:
        """Take the causal pose of a frame; yield the newest piece of the online trajectory."""
        interrupted = self.online.newest is not None and pose.stamp - self.online.newest > _GAP_NS
        if interrupted:
            self._online_tail.clear()
        self.online.add(pose.stamp, pose.T_parent_child, interrupted)
        if pose.covariance is not None:
            self._recent[pose.stamp] = pose.covariance
            if len(self._recent) > _RECENT:
                self._recent.popitem(last=False)
        self._online_tail.append(pose.T_parent_child[:3, 3])
        yield _line(f"{entities.ONLINE}/tail", pose.stamp, self._online_tail, palette.ONLINE)

    def pose(self, pose: StampedPose) -> Iterator[Draw]:
        """Yield the camera and the newest piece of the corrected trajectory."""
        self._corrected_tail.append(pose.T_parent_child[:3, 3])
        yield draw(entities.CAMERA, pose.stamp, transform(pose.T_parent_child))
        yield _line(f"{entities.CORRECTED}/tail", pose.stamp, self._corrected_tail, palette.CORRECTED)

    def path(self, stamp: Stamp, poses: tuple[StampedPose, ...]) -> Iterator[Draw]:
        """Take the corrected key frames; yield the clouds that waited for their places, and what has moved."""
        self._keyframes = poses = tuple(sorted({pose.stamp: pose for pose in poses}.values(), key=lambda p: p.stamp))
        known = {pose.stamp for pose in poses}
        self._covariances = {at: value for at, value in self._covariances.items() if at in known}
        for pose in poses:
            if pose.stamp > self._seen_keyframe:
                self._seen_keyframe = pose.stamp
                if (covariance := self._recent.get(pose.stamp)) is not None:
                    self._covariances[pose.stamp] = covariance
        yield from self._clouds(stamp)

    def cloud(self, keyframe: Stamp, cloud: Cloud) -> Iterator[Draw]:
        """Take the cloud of a newer key frame; yield it when its place is known, and what had to go for it."""
        if self.clouds.newest is not None and keyframe <= self.clouds.newest:
            return
        for gone in self.clouds.keep(keyframe, cloud):
            if self._placed.pop(gone, None) is not None:
                yield draw(f"{entities.CLOUDS}/{gone}", keyframe, rr.Clear(recursive=False))
        yield from self._clouds(keyframe)

    def landmarks(self, stamp: Stamp, points: NDArray[np.float32]) -> Iterator[Draw]:
        """Yield the landmarks (n x 3, map)."""
        self._landmarks = points
        yield draw(entities.LANDMARKS, stamp, rr.Points3D(points[:, :3], colors=palette.LANDMARK, radii=-1.2))

    def loop(self, loop: Loop) -> bool:
        """Take a loop candidate, which is drawn with the next `refresh`; False for one that is known already."""
        if loop in self._loops:
            return False
        self._loops.append(loop)
        while len(self._loops) > self._limit_loops:
            refused = next((old for old in self._loops if not old.accepted), self._loops[0])
            self._loops.remove(refused)
        return True

    def corrected(self) -> Trajectory:
        """Return every pose of the online trail with the correction of the key frame before it, in the map.

        Poses before the first key frame get its correction.
        """
        online = self.online.trajectory()
        if not self._keyframes or not len(online):
            return online
        stamps = np.array([pose.stamp for pose in self._keyframes], dtype=np.int64)
        T_map = np.array([pose.T_parent_child for pose in self._keyframes])
        T_odom, valid = online.at(stamps, _MAX_GAP_S)
        if not valid.any():
            return trajectory(self._keyframes)
        correction = T_map[valid] @ inverse_all(T_odom[valid])
        before = np.clip(np.searchsorted(stamps[valid], online.stamps, side="right") - 1, 0, None)
        return Trajectory(online.stamps, correction[before] @ online.T_world_body)

    def refresh(self, stamp: Stamp, corrected: Trajectory) -> Iterator[Draw]:
        """Yield the whole trajectories, key frames, ellipsoids and loops: what a browser opened now must see."""
        online, strips = self.online.trajectory(), self.online.strips()
        if not len(online):
            return
        same = len(corrected) == len(online)
        strips_corrected = strips if same else np.zeros(len(corrected), dtype=np.int64)
        dashed = dashes(lines(online.positions, strips), _ONLINE_PHASE)
        yield _strips(entities.ONLINE, stamp, dashed, palette.ONLINE, _DASH)
        yield _strips(entities.CORRECTED, stamp, lines(corrected.positions, strips_corrected), palette.CORRECTED)
        self._online_tail, self._corrected_tail = self._online_tail[-1:], self._corrected_tail[-1:]
        if self._keyframes:
            positions = np.array([pose.T_parent_child[:3, 3] for pose in self._keyframes])
            yield draw(entities.KEYFRAMES, stamp, rr.Points3D(positions, colors=palette.CORRECTED, radii=-3.0))
            yield from self._ellipsoids(stamp)
        yield from self._loop_lines(stamp, corrected)

    def _clouds(self, stamp: Stamp, again: bool = False) -> Iterator[Draw]:
        """Yield clouds that are new and places that have moved; both of all key frames if `again`."""
        for keyframe in self._keyframes:
            if keyframe.stamp not in self.clouds:
                continue
            placed = self._placed.get(keyframe.stamp)
            if placed is None or again:
                cloud = self.clouds[keyframe.stamp]
                points = rr.Points3D(cloud.points, colors=cloud.colors, radii=_POINT)
                yield draw(f"{entities.CLOUDS}/{keyframe.stamp}", stamp, points)
            if placed is None or again or np.abs(placed - keyframe.T_parent_child).max() >= _STANDS:
                self._placed[keyframe.stamp] = keyframe.T_parent_child
                yield draw(f"{entities.CLOUDS}/{keyframe.stamp}", stamp, transform(keyframe.T_parent_child))

    def all_points(self, stamp: Stamp) -> Iterator[Draw]:
        """Yield the landmarks and every cloud again, with its place."""
        if len(self._landmarks):
            yield from self.landmarks(stamp, self._landmarks)
        yield from self._clouds(stamp, again=True)

    def _ellipsoids(self, stamp: Stamp) -> Iterator[Draw]:
        known = [pose for pose in self._keyframes if pose.stamp in self._covariances]
        known = known[:: max(1, -(-len(known) // _ELLIPSOIDS))]
        if not known:
            return
        blocks = np.array([self._covariances[pose.stamp][:3, :3] for pose in known])
        variances, axes = np.linalg.eigh(blocks)
        axes[np.linalg.det(axes) < 0, :, 0] *= -1.0
        R = np.array([pose.T_parent_child[:3, :3] for pose in known]) @ axes
        yield draw(
            entities.COVARIANCE,
            stamp,
            rr.Ellipsoids3D(
                centers=[pose.T_parent_child[:3, 3] for pose in known],
                half_sizes=3.0 * np.sqrt(np.maximum(variances, 1e-12)),
                quaternions=Rotation.from_matrix(R).as_quat(),
                colors=palette.ELLIPSOID,
                line_radii=-0.6,
                fill_mode=rr.components.FillMode.DenseWireframe,
            ),
        )

    def _loop_lines(self, stamp: Stamp, corrected: Trajectory) -> Iterator[Draw]:
        if not self._loops:
            return
        ends = [
            corrected.at(np.array([getattr(loop, end) for loop in self._loops], dtype=np.int64), _MAX_GAP_S)
            for end in ("candidate_stamp", "stamp")
        ]
        both = ends[0][1] & ends[1][1]
        accepted = np.array([loop.accepted for loop in self._loops])
        segments = np.stack([ends[0][0][:, :3, 3], ends[1][0][:, :3, 3]], axis=1).astype(np.float32)
        for path, chosen, color, radius in (
            (entities.LOOPS_ACCEPTED, both & accepted, palette.LOOP_ACCEPTED, _LOOP),
            (entities.LOOPS_REFUSED, both & ~accepted, palette.LOOP_REFUSED, _REFUSED),
        ):
            if chosen.any():
                shown = segments[chosen] if radius == _LOOP else segments[chosen][-_REFUSED_SHOWN:]
                yield draw(path, stamp, rr.LineStrips3D(shown, colors=[color], radii=radius))


def trajectory(poses: tuple[StampedPose, ...]) -> Trajectory:
    """Return the poses as a trajectory; one that is not newer than all before it is left out."""
    stamps = np.array([pose.stamp for pose in poses], dtype=np.int64)
    newer = np.ones(len(stamps), dtype=bool)
    newer[1:] = stamps[1:] > np.maximum.accumulate(stamps)[:-1]
    return Trajectory(stamps[newer], np.array([pose.T_parent_child for pose in poses])[newer])


def truth_line(body: str, stamp: Stamp, positions: Array, strips: NDArray[np.int64]) -> Draw:
    """Return the true trajectory of a body, positions n x 3 in the map."""
    dashed = dashes(lines(positions, strips), _TRUTH_PHASE)
    return _strips(f"{entities.TRUTH}/{body}", stamp, dashed, palette.TRUTH, _DASH)


def _line(path: str, stamp: Stamp, positions: list[Array], color: palette.Rgb) -> Draw:
    return _strips(path, stamp, [np.array(positions, dtype=np.float32)], color)


def _strips(
    path: str, stamp: Stamp, strips: list[NDArray[np.float32]], color: palette.Rgb, width: float = _LINE
) -> Draw:
    return draw(path, stamp, rr.LineStrips3D(strips, colors=[color], radii=width))
