"""Which key frames were registered against which, and the covariance between any two of them that follows.

The surest path between two is searched here while frames pass, one key frame after the other, and cached; for loop
closures `SegmentGraph` searches it in arrays in the background, where Python loops would hold up the frames.
"""

import heapq
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from odom.backend.map.edge_table import EdgeTable
from odom.backend.map.journal import Journal
from odom.backend.map.keyframe import Keyframe
from odom.backend.map.pose_graph import Edge
from odom.geometry import se3
from odom.geometry.arrays import Array

_MOST_CACHED = 4096
"""Covariances between key frames that are kept, some 2 MB; then all are found anew."""


class Registrations:
    """The graph of registrations: for every key frame its own, by the other one's number; all of them as a `table`.

    A forgotten key frame keeps the one with its heir, which is not in the heir's own list. Covariances that were asked
    for are cached until paths change; a `journal` notes what changes.
    """

    def __init__(self) -> None:
        self._of: defaultdict[int, dict[int, Edge]] = defaultdict(dict)
        self._between: dict[tuple[int, int], Array | None] = {}
        self._leaf_of: dict[int, int] = {}
        """Key frames registered with a single older one, and which: all paths from older ones pass through that. They
        are forgotten as soon as a registration joins key frames in another way. A leaf's other descendants have higher
        numbers, so every lower one is reached through its parent."""
        self.table = EdgeTable()
        self.journal = Journal()

    def add(self, edge: Edge) -> None:
        """Add a registration; of two between the same key frames the one of smaller covariance stays.

        It counts as part of the chain if either of the two did.
        """
        known = self._of[edge.a].get(edge.b)
        if known is not None:
            is_loop = edge.is_loop and known.is_loop
            edge = replace(min(edge, known, key=lambda e: e.variance), is_loop=is_loop)
        if edge.a < edge.b and not self._of[edge.b]:
            self._leaf_of[edge.b] = edge.a
        else:
            self._forget_paths()
        self._put(edge)

    def _forget_paths(self) -> None:
        self._between.clear()
        self._leaf_of.clear()

    def _put(self, edge: Edge) -> None:
        self._of[edge.a][edge.b] = self._of[edge.b][edge.a] = edge
        self.table.put(edge)
        self.journal.note_registration(edge.a, edge.b)

    def between(self, a: int, b: int) -> Edge:
        """Return the registration of two key frames."""
        return self._of[a][b]

    def of(self, number: int) -> list[Edge]:
        """Return the registrations of a key frame, each with its `number` as `a`."""
        return [edge.seen_from(number) for edge in self._of[number].values()]

    def among(self, numbers: Collection[int]) -> list[Edge]:
        """Return the registrations between any two of the key frames."""
        return [edge for n in numbers for m, edge in self._of[n].items() if n < m and m in numbers]

    def adjust(self, numbers: Iterable[int], keyframes: Sequence[Keyframe]) -> None:
        """Set the registrations of the key frames `numbers` to what their poses are after an adjustment.

        Covariances that are cached stay: they turn by no more than the poses do.
        """
        for edge in [edge for n in numbers for edge in self._of[n].values()]:
            T_a_b = keyframes[edge.a].T_camera_map @ se3.inverse(keyframes[edge.b].T_camera_map)
            self._put(replace(edge, T_a_b=T_a_b))

    def hand_over(self, number: int, heir: int) -> list[int]:
        """Hand the registrations of a key frame that is forgotten to its `heir`; return the other key frames' numbers.

        Each is composed with the registration of the two, so that no chain's covariance shrinks, and one through both
        stays as it was.
        """
        self._forget_paths()
        known = self._of[number].pop(heir).seen_from(heir)
        others = self.of(number)
        for edge in others:
            del self._of[edge.b][number]
            self.table.drop(edge.b, number)
            self.add(known.then(edge))
        del self._of[heir][number]
        self.table.drop(heir, number)
        self._of[number] = {heir: known}
        return [edge.b for edge in others]

    def covariance_between(self, a: int, b: int) -> Array | None:
        """Return the 6 x 6 covariance (`se3`, frame b) of T_a_b along the surest path, None where there is none.

        Of two key frames, only `a` may be forgotten.
        """
        onward: list[Edge] = []
        while (a, b) not in self._between and a < b and b in self._leaf_of:
            onward.append(self._of[b][self._leaf_of[b]].seen_from(self._leaf_of[b]))
            b = self._leaf_of[b]
        if len(self._between) > _MOST_CACHED:
            self._between.clear()
        if (a, b) not in self._between:
            self._between[a, b] = self._covariance_of(self._surest_path(a, b))
        found = self._between[a, b]
        for edge in reversed(onward):
            found = None if found is None else se3.compose_covariance(found, edge.T_a_b, edge.covariance)
            self._between[a, edge.b] = found
        return found

    @staticmethod
    def _covariance_of(path: list[Edge] | None) -> Array | None:
        if path is None:
            return None
        total = np.zeros((6, 6))
        for edge in path:
            total = se3.compose_covariance(total, edge.T_a_b, edge.covariance)
        return total

    def surest_of(self, number: int, others: Collection[int]) -> int | None:
        """Return which of the `others` the surest path from key frame `number` leads to, None where none does."""
        return next((at for at, _, _ in self._outward(number) if at in others), None)

    def covariances_from(self, a: int) -> dict[int, Array]:
        """Return the 6 x 6 covariances (`se3`, frame b) of T_a_b along the surest paths, by b, `a` itself included."""
        found = {a: np.zeros((6, 6))}
        for at, start, edge in self._outward(a):
            onward = edge.seen_from(start)
            found[at] = se3.compose_covariance(found[start], onward.T_a_b, onward.covariance)
        return found

    def _surest_path(self, a: int, b: int) -> list[Edge] | None:
        """Return the registrations from `a` to `b`, each as seen from where it is left."""
        if a == b:
            return []
        before: dict[int, tuple[int, Edge]] = {}
        for at, start, edge in self._outward(a):
            before[at] = start, edge
            if at == b:
                break
        path: list[Edge] = []
        while b in before:
            start, edge = before[b]
            path.insert(0, edge.seen_from(start))
            b = start
        return path or None

    def _outward(self, a: int) -> Iterator[tuple[int, int, Edge]]:
        """Yield key frames, surest from `a` first, with the one before and the edge from there (E. Dijkstra, 1959)."""
        before: dict[int, tuple[int, Edge]] = {}
        variance, waiting, done = {a: 0.0}, [(0.0, a)], set()
        while waiting:
            far, at = heapq.heappop(waiting)
            if at in done:
                continue
            done.add(at)
            if at != a:
                yield at, *before[at]
            for other, edge in self._of[at].items():
                farther = far + edge.variance
                if farther < variance.get(other, np.inf):
                    variance[other], before[other] = farther, (at, edge)
                    heapq.heappush(waiting, (farther, other))
