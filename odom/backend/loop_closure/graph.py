"""The pose graph of one segment as it was at one frame: frozen, so that the background can work on it.

The `Registrations` of the map answer the same questions at the present frame (see there).
"""

from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from odom.backend.map.map import Map
from odom.backend.map.moved_keyframes import changes_in_map, followed
from odom.backend.map.pose_graph import Edge, EdgeArrays, optimise
from odom.geometry import se3
from odom.geometry.arrays import Array, Index, Mask


@dataclass(frozen=True, eq=False)
class Moves:
    """Key frames `numbers` (ascending) that go from T_camera_map `before` to `after` (4 x 4 each)."""

    numbers: list[int]
    before: list[Array]
    after: list[Array]


@dataclass(frozen=True, eq=False)
class SegmentGraph:
    """Key frames `numbers` (K, ascending) of a segment, each with its T_camera_map, and the `edges` among them.

    The oldest is held, or all those of a saved map that is fixed. `edges` name their ends by row; the map had `size`
    key frames.
    """

    segment: int
    size: int
    numbers: Index
    poses: tuple[Array, ...]
    is_held: Mask
    edges: EdgeArrays

    @classmethod
    def of(cls, map_: Map, segment: int) -> "SegmentGraph":
        """Return the graph of those key frames of a segment that are not forgotten, in memory or not."""
        members = members_of(map_, segment)
        held = members[:1]
        if map_.is_fixed:
            held = [n for n in members if n < map_.earlier_keyframes]
        numbers = np.array(members, dtype=np.int64)
        row = np.full(len(map_.keyframes), -1, dtype=np.int64)
        row[numbers] = np.arange(len(numbers))
        edges = map_.registrations.table.among(row >= 0)
        poses = tuple(map_.keyframes[n].T_camera_map for n in members)
        edges = replace(edges, a=row[edges.a], b=row[edges.b])
        return cls(segment, len(map_.keyframes), numbers, poses, np.isin(numbers, held), edges)

    def with_closures(self, closures: Sequence[Edge]) -> "SegmentGraph":
        """Return the graph with further edges, between key frames that are in it."""
        more = EdgeArrays.of(closures)
        rows = np.searchsorted(self.numbers, more.a), np.searchsorted(self.numbers, more.b)
        return replace(self, edges=self.edges.joined(replace(more, a=rows[0], b=rows[1])))

    def optimised(self) -> Moves:
        """Return where the key frames that are not held go, so that all edges agree best."""
        after = optimise(np.array(self.poses), self.is_held, self.edges)
        rows = np.flatnonzero(~self.is_held).tolist()
        straight = followed(after, np.eye(4)[None], np.zeros(len(after), dtype=np.int64))
        return Moves(self.numbers[rows].tolist(), [self.poses[row] for row in rows], list(straight[rows]))

    def holds(self, edge: Edge) -> bool:
        """Return whether both ends of an edge are in the graph."""
        return bool(np.isin([edge.a, edge.b], self.numbers).all())

    def T_between(self, a: int, b: int) -> Array:
        """Return T_a_b of two of the key frames."""
        row_a, row_b = np.searchsorted(self.numbers, [a, b])
        return np.asarray(self.poses[row_a] @ se3.inverse(self.poses[row_b]))

    def covariance_between(self, a: int, b: int) -> Array | None:
        """Return the 6 x 6 covariance (`se3`, frame b) of T_a_b along the surest path, None where there is none."""
        row_a, row_b = (int(row) for row in np.searchsorted(self.numbers, [a, b]))
        way = self._surest_path(row_a, row_b)
        if way is None:
            return None
        ends = np.array([self.poses[row] for row in self.edges.b[way]]).reshape(-1, 4, 4)
        A = se3.adjoints(self.poses[row_b] @ changes_in_map(np.tile(np.eye(4), (len(way), 1, 1)), ends))
        return np.asarray((A @ self.edges.covariance[way] @ A.transpose(0, 2, 1)).sum(axis=0))

    def _surest_path(self, row_a: int, row_b: int) -> Index | None:
        """Return the edges from one row to another whose variances add up to least, as `Registrations` finds them."""
        K, e = len(self.numbers), self.edges
        variance = np.trace(e.covariance, axis1=1, axis2=2)
        graph = csr_matrix((variance, (e.a, e.b)), shape=(K, K))
        _, before = dijkstra(graph, directed=False, indices=[row_a], return_predecessors=True)
        passed = [row_b]
        while passed[-1] != row_a:
            if before[0, passed[-1]] < 0:
                return None
            passed.append(int(before[0, passed[-1]]))
        ends = np.array(passed)
        name = np.minimum(e.a, e.b) * K + np.maximum(e.a, e.b)
        order = np.argsort(name)
        wanted = np.minimum(ends[1:], ends[:-1]) * K + np.maximum(ends[1:], ends[:-1])
        return np.asarray(order[np.searchsorted(name, wanted, sorter=order)])

    def take_over(self, map_: Map, moves: Moves, merged: Iterable[int] = ()) -> None:
        """Move the map as the graph is `optimised`.

        What was adjusted since is moved from where it is now; what is new, or was `merged` into the segment since,
        moves with the key frames that it is registered against.
        """
        keyframes, away, here = map_.keyframes, map_.away, dict[int, Array]()
        for number, before, after in zip(moves.numbers, moves.before, moves.after, strict=True):
            keyframe = keyframes[number]
            T = after if keyframe.T_camera_map is before else keyframe.T_camera_map @ se3.inverse(before) @ after
            if number in away:
                keyframe.T_camera_map = T
            else:
                here[number] = T
        map_.journal.note_moved_only(moves.numbers)
        new = [n for n in (*merged, *range(self.size, len(keyframes))) if keyframes[n].segment == self.segment]
        here |= _added(map_, moves, new)
        for number in here.keys() & map_.forgotten:
            del here[number]
        map_.move_keyframes(np.array(list(here), dtype=np.int64), np.array(list(here.values())))


def _added(map_: Map, moves: Moves, waiting: list[int]) -> dict[int, Array]:
    """Return T_camera_map, by number, of those of the `waiting` key frames that edges connect with what moves."""
    turned: dict[int, Array] = {}
    """How the map moves around each key frame: T_camera_map is multiplied by this from the right."""
    while waiting:
        left: list[int] = []
        for number in waiting:
            for edge in map_.registrations.of(number):
                row = bisect_left(moves.numbers, edge.b)
                if edge.b in turned:
                    turned[number] = turned[edge.b]
                elif row < len(moves.numbers) and moves.numbers[row] == edge.b:
                    turned[number] = se3.inverse(moves.before[row]) @ moves.after[row]
                if number in turned:
                    break
            else:
                left.append(number)
        if len(left) == len(waiting):
            break
        waiting = left
    return {number: map_.keyframes[number].T_camera_map @ turn for number, turn in turned.items()}


def members_of(map_: Map, segment: int) -> list[int]:
    """Return the key frames of a segment that are not forgotten, in memory or not, in order."""
    keyframes = map_.keyframes
    return [n for n in sorted(map_.away.union(map_.remembered)) if keyframes[n].segment == segment]
