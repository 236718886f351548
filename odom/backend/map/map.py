"""The map: key frames, the landmarks they measured, and the places they show."""

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np

from odom.backend.map.corners import Corners
from odom.backend.map.journal import Journal
from odom.backend.map.keyframe import Keyframe, MeasuredLandmarks, pose_distances
from odom.backend.map.landmarks import Landmarks
from odom.backend.map.moved_keyframes import carry_landmarks, changes_in_map, followed
from odom.backend.map.pose_graph import Edge
from odom.backend.map.registrations import Registrations
from odom.backend.map.saved import Details
from odom.backend.map.tuning import TUNING
from odom.frontend.camera.depth_tilt import without_tilt
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.features.assumed_depth import with_assumed_depth
from odom.frontend.features.measurement import Measurements, points_of
from odom.frontend.features.patches import cut_patches
from odom.frontend.features.view import View
from odom.frontend.matching.place_recognition import PlaceIndex
from odom.geometry import se3
from odom.geometry.arrays import Array, Index


@dataclass(eq=False)
class Map:
    """Key frames, landmarks, and which key frames are linked: by common landmarks, succession or loop closure.

    `remembered` and `forgotten` are the numbers of key frames that still have their landmarks and of those that were
    pruned (see `pruning`), each in order; `followers` the forgotten ones that move with a remembered one, by its
    number. `places` is the index of what the remembered ones look like.

    A saved map (see `memory`) has `details`: they fetch what was measured by key frames that are `away`, too far from
    the camera to be in memory, unless that is `unreadable`. Either the map is extended, and `journal` notes what
    changes, or it `is_fixed`. So many `earlier_keyframes`, the first ones, were made before this `session`: adjustments
    leave them where they are, and in a fixed map closed loops do so too.
    """

    landmarks: Landmarks = field(default_factory=Landmarks)
    keyframes: list[Keyframe] = field(default_factory=list)
    links: list[set[int]] = field(default_factory=list)
    remembered: list[int] = field(default_factory=list)
    forgotten: list[int] = field(default_factory=list)
    registrations: Registrations = field(default_factory=Registrations)
    places: PlaceIndex = field(default_factory=PlaceIndex)
    followers: dict[int, list[int]] = field(default_factory=dict)
    away: set[int] = field(default_factory=set)
    unreadable: set[int] = field(default_factory=set)
    details: Details | None = None
    journal: Journal = field(default_factory=Journal)
    earlier_keyframes: int = 0
    session: int = 0

    @property
    def is_fixed(self) -> bool:
        """Whether the camera is only looked for in what was saved, and nothing of that changes."""
        return self.details is not None and not self.journal.is_kept

    def add_keyframe(
        self,
        view: View,
        T_camera_map: Array,
        known: MeasuredLandmarks,
        timing: ShutterTiming,
        against: int | None,
        covariance: Array,
    ) -> Keyframe:
        """Add a key frame that measured `known` landmarks; `add_corners` adds those that it is the first to show.

        `against` is the key frame it was registered against, with that `covariance` (6 x 6); None begins a segment.
        """
        number = len(self.keyframes)
        beginning = None if against is None else self.keyframes[against]
        keyframe = Keyframe(
            number=number,
            frame=view.number,
            stamp=view.stamp,
            segment=self._next_segment() if beginning is None else beginning.segment,
            first=number if beginning is None else beginning.first,
            T_camera_map=T_camera_map.copy(),
            rows=known.rows,
            identities=self.landmarks.identity[known.rows].copy(),
            uv=known.uv,
            measurements=known.measurements,
            timing=timing,
            covariance_since_start=covariance,
            session=self.session,
        )
        self.keyframes.append(keyframe)
        self.journal.note_new_or_moved([number])
        self.journal.note_new_details([number])
        self.remembered.append(number)
        anchors, shared = np.unique(self.landmarks.keyframe[known.rows], return_counts=True)
        self.links.append(set())
        enough = min(TUNING.link_landmarks, max(shared, default=0))  # at least one link, also where a crowd hides most
        for other in anchors[shared >= enough].tolist():
            self.link(number, other)
        if against is not None:
            T_against_keyframe = self.keyframes[against].T_camera_map @ se3.inverse(T_camera_map)
            self.register(Edge(against, number, T_against_keyframe, covariance))
        return keyframe

    def add_corners(self, keyframe: Keyframe, view: View, corners: Corners, tilt: Array) -> None:
        """Make landmarks of new `corners` that a key frame shows in its `view`, whose depth has a `tilt` (2)."""
        rows = self._add_landmarks(keyframe.number, keyframe.T_camera_map, view, corners, tilt)
        keyframe.rows = np.concatenate([keyframe.rows, rows])
        keyframe.identities = np.concatenate([keyframe.identities, self.landmarks.identity[rows]])
        keyframe.uv = np.concatenate([keyframe.uv, corners.uv])
        keyframe.measurements = keyframe.measurements.joined(corners.measurements)
        self.journal.note_new_details([keyframe.number])

    def _next_segment(self) -> int:
        return 1 + max((k.segment for k in self.keyframes), default=-1)

    def register(self, edge: Edge) -> None:
        """Add a registration; unless it closes a loop, `edge.b`'s covariance since the start follows from it."""
        self.registrations.add(edge)
        self.link(edge.a, edge.b)
        if not edge.is_loop:
            self.propagate_covariance(edge)

    def propagate_covariance(self, edge: Edge) -> None:
        """Set the covariance since the start of `edge.b` to that of `edge.a` composed with their registration's."""
        self.journal.note_new_or_moved([edge.b])
        self.keyframes[edge.b].covariance_since_start = se3.compose_covariance(
            self.keyframes[edge.a].covariance_since_start, edge.T_a_b, edge.covariance
        )

    def _add_landmarks(self, keyframe: int, T_camera_map: Array, view: View, corners: Corners, tilt: Array) -> Index:
        """Make landmarks of the `corners` that a key frame measured; return their rows (n)."""
        measured = with_assumed_depth(corners.measurements.straight(tilt), view.depth_mm)
        points, covariances = points_of(measured, TUNING.anchor_share)
        T_map_camera = se3.inverse(T_camera_map)
        R = T_map_camera[:3, :3]
        rows = self.landmarks.add(
            se3.apply(T_map_camera, points),
            R @ covariances @ R.T,
            keyframe,
            corners.uv,
            np.column_stack([measured.values[:, 2], measured.slope]),
            cut_patches(view.images.full, corners.uv),
            cut_patches(view.images.half, corners.uv / 2.0),
        )
        self.landmarks.assumed[rows] = ~corners.has_depth
        return rows

    def remeasure(self, keyframe: Keyframe, measured: Measurements, timing: ShutterTiming, tilt: Array) -> None:
        """Replace a key frame's measurements (n, in the order of its rows), and move the landmarks it made.

        Their depth has a `tilt` (2). Where depth is missing now or was before, the old values stay, as covariances do;
        a landmark without depth stays as far away as it was.
        """
        self.journal.note_new_details([keyframe.number])
        before = keyframe.measurements
        values = np.where(np.isnan(measured.values + before.values), before.values, measured.values)
        keyframe.measurements = replace(measured, values=values, covariance=before.covariance)
        keyframe.timing = timing
        L = self.landmarks
        own = keyframe.current(L) & (L.keyframe[keyframe.rows] == keyframe.number)
        rows, (x, y, w) = keyframe.rows[own], without_tilt(values[own], tilt).T
        w = np.where(np.isnan(w), L.plane[rows, 0], w)
        L.position[rows] = se3.apply(
            se3.inverse(keyframe.T_camera_map), np.column_stack([x, y, np.ones_like(x)]) / w[:, None]
        )
        L.plane[rows] = np.column_stack([w, measured.slope[own]])

    def link(self, a: int, b: int) -> None:
        """Link key frames `a` and `b`: where one is near, the other's landmarks are looked for too."""
        if a != b:
            self.links[a].add(b)
            self.links[b].add(a)
            self.journal.note_new_or_moved([max(a, b)])

    def linked(self, number: int) -> set[int]:
        """Return the key frames linked with `number` over two hops, itself included: no loop is closed with them."""
        near = self.links[number] | {number}
        return near.union(*(self.links[k] for k in near))

    def members(self, segment: int) -> list[Keyframe]:
        """Return the key frames of a segment that are remembered."""
        return [k for n in self.remembered if (k := self.keyframes[n]).segment == segment]

    def neighbours(self, keyframe: int, T_camera_map: Array, most: int, but: Collection[int] = frozenset()) -> Index:
        """Return up to `most` key frames linked to `keyframe` over a few hops, nearest to the pose first.

        Those in `but` are left out.
        """
        return self.nearest(sorted(self.around(keyframe, most).difference(but, self.away)), T_camera_map)[:most]

    def around(self, keyframe: int, most: int) -> set[int]:
        """Return the key frames linked to `keyframe` over a few hops, itself included; enough to choose `most` from."""
        reached, edge = {keyframe}, {keyframe}
        for _ in range(TUNING.neighbour_hops):
            edge = set().union(*(self.links[k] for k in edge)) - reached
            reached |= edge
            if len(reached) > 4 * most:
                break
        return reached

    def nearest(self, keyframes: list[int], T_camera_map: Array) -> Index:
        """Return `keyframes` ordered by how near they are to a pose (see `pose_distances`)."""
        numbers = np.array(keyframes, dtype=np.int64)
        poses = np.array([self.keyframes[k].T_camera_map for k in keyframes]).reshape(-1, 4, 4)
        far = pose_distances(T_camera_map, poses)
        return np.asarray(numbers[np.argsort(far, kind="stable")])

    def cull(self, keyframes: Index) -> None:
        """Remove landmarks of `keyframes` that were looked for in several frames and hardly ever found."""
        L = self.landmarks
        is_bad = (L.tried >= TUNING.cull_trials) & (L.seen < TUNING.cull_share * L.tried)
        rows = np.flatnonzero(L.alive & is_bad & np.isin(L.keyframe, keyframes))
        self.journal.note_fewer_landmarks(L.keyframe[rows].tolist())
        L.cull(rows)

    def move_keyframes(self, numbers: Index, T_camera_map: Array, adjusted_rows: Index | None = None) -> None:
        """Give key frames `numbers` (n) new poses (n x 4 x 4); their followers and landmarks move along.

        `adjusted_rows` are landmarks that do not, since they were moved already.
        """
        if not len(numbers):
            return
        L = self.landmarks
        follows = L.alive.copy()
        if adjusted_rows is not None:
            follows[adjusted_rows] = False
        moved = [self.keyframes[number] for number in numbers.tolist()]
        here = np.flatnonzero([number not in self.away for number in numbers.tolist()])
        before = np.array([moved[row].T_camera_map for row in here.tolist()]).reshape(-1, 4, 4)
        T_new_old = changes_in_map(before, T_camera_map[here])
        row_of = np.full(len(self.keyframes), -1, dtype=np.int64)
        row_of[numbers[here]] = np.arange(len(here))
        carry_landmarks(T_new_old, row_of, L.keyframe, follows, L.position, L.covariance)
        for keyframe, T in zip(moved, followed(T_camera_map, np.eye(4)[None], np.zeros_like(numbers)), strict=True):
            keyframe.T_camera_map = T
        self.journal.note_moved_only(numbers.tolist())
        self._follow(numbers[here].tolist(), T_new_old)

    def _follow(self, heirs: list[int], T_new_old: Array) -> None:
        """Move the followers of each of the `heirs` (n) as the map around it moved, by `T_new_old` (n x 4 x 4)."""
        following = [(n, row) for row, heir in enumerate(heirs) for n in self.followers.get(heir, ())]
        if following:
            behind = [self.keyframes[n] for n, _ in following]
            rows = np.array([row for _, row in following])
            T = followed(np.array([k.T_camera_map for k in behind]), T_new_old, rows)
            for follower, T_camera_map in zip(behind, T, strict=True):
                follower.T_camera_map = T_camera_map
