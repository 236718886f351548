"""The map: key frames and the landmarks they measured, and how it grows."""

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from odom.backend.graph import Edge
from odom.backend.keyframes import Keyframe, Measured
from odom.backend.landmarks import Landmarks
from odom.backend.registrations import Registrations
from odom.frame import Stamp
from odom.frontend.images import FrameImages
from odom.frontend.measure import Measurements, points_of
from odom.frontend.patches import cut_patches
from odom.frontend.timing import Timing
from odom.registration import se3

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_ANCHOR_SHARE = 0.1
"""Share of the ray's variance that a new landmark keeps: its patch is cut where it was measured, by definition."""
_TRIALS, _SHARE_SEEN = 8, 0.25
_LINKED = 15
_HOPS = 3
_CLOUD = 20_000
_PATH = 2_000


@dataclass(eq=False)
class Map:
    """Key frames, landmarks, and which key frames are linked: by common landmarks, succession or loop closure.

    `remembered` are the numbers of the key frames that are not forgotten (see `forgetting`), in order, `forgotten` the
    others', in theirs; `followers` the forgotten ones that move with a remembered one, by its number.
    """

    landmarks: Landmarks = field(default_factory=Landmarks)
    keyframes: list[Keyframe] = field(default_factory=list)
    links: list[set[int]] = field(default_factory=list)
    remembered: list[int] = field(default_factory=list)
    forgotten: list[int] = field(default_factory=list)
    registrations: Registrations = field(default_factory=Registrations)
    followers: dict[int, list[int]] = field(default_factory=dict)

    def add_keyframe(
        self,
        stamp: Stamp,
        segment: int,
        T_camera_map: Array,
        images: FrameImages,
        known: Measured,
        corners: Array,
        measured_corners: Measurements,
        timing: Timing,
        against: int | None,
        covariance: Array,
    ) -> Keyframe:
        """Keep a frame that measured `known` landmarks and new `corners`, which become landmarks.

        `against` is the key frame it was registered against, with that `covariance` (6 x 6); None begins a segment.
        """
        number = len(self.keyframes)
        new_rows = self._add_landmarks(number, T_camera_map, images, corners, measured_corners)
        all_rows = np.concatenate([known.rows, new_rows])
        keyframe = Keyframe(
            number=number,
            stamp=stamp,
            segment=segment,
            first=number if against is None else self.keyframes[against].first,
            T_camera_map=T_camera_map.copy(),
            rows=all_rows,
            identities=self.landmarks.identity[all_rows].copy(),
            uv=np.concatenate([known.uv, corners]),
            measurements=known.measurements.joined(measured_corners),
            timing=timing,
            covariance_since_start=covariance,
        )
        self.keyframes.append(keyframe)
        self.remembered.append(number)
        anchors, shared = np.unique(self.landmarks.keyframe[known.rows], return_counts=True)
        self.links.append(set())
        for other in anchors[shared >= _LINKED].tolist():
            self.link(number, other)
        if against is not None:
            T_against_keyframe = self.keyframes[against].T_camera_map @ se3.inverse(T_camera_map)
            self.register(Edge(against, number, T_against_keyframe, covariance))
        return keyframe

    def register(self, edge: Edge) -> None:
        """Take note of a registration; unless it closes a loop, `edge.b` is as sure of the start as `edge.a` and it."""
        self.registrations.add(edge)
        self.link(edge.a, edge.b)
        if not edge.is_loop:
            self.go_on(edge)

    def go_on(self, edge: Edge) -> None:
        """Let key frame `edge.b` be as sure of the start as `edge.a` is and their registration allows."""
        self.keyframes[edge.b].covariance_since_start = se3.compose_covariance(
            self.keyframes[edge.a].covariance_since_start, edge.T_a_b, edge.covariance
        )

    def _add_landmarks(
        self, keyframe: int, T_camera_map: Array, images: FrameImages, corners: Array, measured: Measurements
    ) -> Index:
        """Make landmarks of the `corners` (n x 2, px) that a key frame measured; return their rows (n)."""
        points, covariances = points_of(measured, _ANCHOR_SHARE)
        T_map_camera = se3.inverse(T_camera_map)
        R = T_map_camera[:3, :3]
        return self.landmarks.add(
            se3.apply(T_map_camera, points),
            R @ covariances @ R.T,
            keyframe,
            corners,
            np.column_stack([measured.values[:, 2], measured.slope]),
            cut_patches(images.full, corners),
            cut_patches(images.half, corners / 2.0),
        )

    def remeasure(self, keyframe: Keyframe, measured: Measurements, timing: Timing) -> None:
        """Let a key frame have measured its landmarks so, n in the order of its rows, and move those that are its own.

        Depth that is missing now or was missing then stays what it was, and so do covariances.
        """
        before = keyframe.measurements
        values = np.where(np.isnan(measured.values + before.values), before.values, measured.values)
        keyframe.measurements = replace(measured, values=values, covariance=before.covariance)
        keyframe.timing = timing
        L = self.landmarks
        own = keyframe.current(L) & (L.keyframe[keyframe.rows] == keyframe.number)
        rows, (x, y, w) = keyframe.rows[own], values[own].T
        L.position[rows] = se3.apply(
            se3.inverse(keyframe.T_camera_map), np.column_stack([x, y, np.ones_like(x)]) / w[:, None]
        )
        L.plane[rows] = np.column_stack([w, measured.slope[own]])

    def link(self, a: int, b: int) -> None:
        """Let the landmarks of key frames `a` and `b` be looked for together."""
        if a != b:
            self.links[a].add(b)
            self.links[b].add(a)

    def linked(self, number: int) -> set[int]:
        """Return the key frames linked with `number` over two hops, itself included: it needs no closure with them."""
        near = self.links[number] | {number}
        return near.union(*(self.links[k] for k in near))

    def members(self, segment: int) -> list[Keyframe]:
        """Return the key frames of a segment that are remembered."""
        return [k for n in self.remembered if (k := self.keyframes[n]).segment == segment]

    def path(self) -> tuple[tuple[Stamp, Array], ...]:
        """Return stamp and T_map_camera at it of the key frames; of forgotten ones at most 2,000, thinned evenly."""
        kept = sorted([*self.forgotten[:: 1 + len(self.forgotten) // _PATH], *self.remembered])
        shown = [self.keyframes[n] for n in kept]
        T_map_camera = np.linalg.inv([k.T_camera_map for k in shown]) @ [k.T_middle_stamp for k in shown]
        return tuple((k.stamp, T) for k, T in zip(shown, T_map_camera, strict=True))

    def cloud(self) -> Array:
        """Return landmarks (n x 3, m, map frame) that were seen more than once, thinned evenly to at most 20,000."""
        rows = np.flatnonzero(self.landmarks.alive & (self.landmarks.seen > 1))
        return np.asarray(self.landmarks.position[rows[:: 1 + len(rows) // _CLOUD]])

    def neighbours(self, keyframe: int, T_camera_map: Array, most: int, but: Collection[int] = frozenset()) -> Index:
        """Return up to `most` key frames linked to `keyframe` over a few hops, nearest to the pose first.

        Those of `but` are left out.
        """
        reached, edge = {keyframe}, {keyframe}
        for _ in range(_HOPS):
            edge = set().union(*(self.links[k] for k in edge)) - reached
            reached |= edge
            if len(reached) > 4 * most:
                break
        return self.nearest(sorted(reached.difference(but)), T_camera_map)[:most]

    def nearest(self, keyframes: list[int], T_camera_map: Array) -> Index:
        """Return `keyframes` ordered by how near they are to a pose.

        Near is metres plus radians: at a metre's depth, both move a feature about as far.
        """
        numbers = np.array(keyframes)
        T = np.array([self.keyframes[k].T_camera_map for k in numbers])
        R = T_camera_map[:3, :3] @ T[:, :3, :3].transpose(0, 2, 1)
        apart_m = np.linalg.norm(T_camera_map[:3, 3] - np.einsum("kij,kj->ki", R, T[:, :3, 3]), axis=1)
        apart_rad = np.arccos(np.clip((np.trace(R, axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0))
        return np.asarray(numbers[np.argsort(apart_m + apart_rad, kind="stable")])

    def cull(self, keyframes: Index) -> None:
        """Give up landmarks of `keyframes` that were looked for in several frames and hardly ever found."""
        L = self.landmarks
        concerned = np.isin(L.keyframe, keyframes)
        L.cull(np.flatnonzero(L.alive & concerned & (L.tried >= _TRIALS) & (L.seen < _SHARE_SEEN * L.tried)))

    def move_keyframes(self, numbers: Index, T_camera_map: Array, adjusted_rows: Index) -> None:
        """Give key frames new poses; their landmarks go with them, except `adjusted_rows`, which already have.

        So do their followers.
        """
        L = self.landmarks
        follows = L.alive.copy()
        follows[adjusted_rows] = False
        for number, T in zip(numbers, T_camera_map, strict=True):
            keyframe = self.keyframes[number]
            T_new_old = se3.inverse(T) @ keyframe.T_camera_map
            rows = np.flatnonzero(follows & (L.keyframe == number))
            L.position[rows] = se3.apply(T_new_old, L.position[rows])
            R_new_old = T_new_old[:3, :3]
            L.covariance[rows] = R_new_old @ L.covariance[rows] @ R_new_old.T
            keyframe.T_camera_map = se3.orthonormal(T)
            for follower in (self.keyframes[n] for n in self.followers.get(int(number), ())):
                follower.T_camera_map = se3.orthonormal(follower.T_camera_map @ se3.inverse(T_new_old))
