"""Loops closed in the background: confirmed candidates are compared with the chain, and the map's motion is computed.

In a large map that takes longer than a frame.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from odom.backend.estimate import LoopCandidate
from odom.backend.loop_closure.candidate import ConfirmedCandidate, add_old_landmarks
from odom.backend.loop_closure.graph import Moves, SegmentGraph
from odom.backend.loop_closure.tuning import TUNING
from odom.backend.loop_closure.verification import contradiction
from odom.backend.map.map import Map
from odom.backend.map.pose_graph import Edge
from odom.backend.mapping.background import Background
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import SteadyStamp, later

_FRAME_S = 1.0 / 30.0
"""Seconds in which a frame's worth of background work is done, however few frames come meanwhile."""


@dataclass(frozen=True, eq=False)
class _Closed:
    """Candidates, each with the reason to refuse it (empty: accepted), and the `moves` by the accepted ones, if any."""

    graph: SegmentGraph
    found: Sequence[ConfirmedCandidate]
    refusals: Sequence[str]
    moves: Moves | None


class BackgroundClosing:
    """Confirmed candidates of `map_` that wait for their loop to be closed, one segment at a time."""

    def __init__(self, map_: Map) -> None:
        self._map = map_
        self._waiting: list[ConfirmedCandidate] = []
        self._background = Background[_Closed]("closing")
        self._is_stale = False
        """Whether the result of the background is to be dropped."""
        self._rests_until = 0
        self._merged: list[int] = []
        """Key frames that were merged with another segment since the background began."""

    @property
    def is_busy(self) -> bool:
        """Whether loops are being closed in the background."""
        return self._background.is_busy

    @property
    def has_waiting(self) -> bool:
        """Whether candidates wait for their loop to be closed."""
        return bool(self._waiting)

    def add(self, found: ConfirmedCandidate) -> None:
        """Let one more candidate wait; of too many, the oldest are forgotten."""
        self._waiting = [*self._waiting, found][-TUNING.most_waiting :]

    def drop(self) -> None:
        """Forget the candidates that wait, and what is being computed of others."""
        self._waiting, self._is_stale = [], self._background.is_busy

    def note_merged(self, keyframes: Iterable[int]) -> None:
        """Note that key frames have been merged with another segment, where a loop may be closing."""
        self._merged += keyframes

    def start(self, count: int | None, sensor: SensorModel) -> None:
        """Begin to close the waiting loops of one segment, if idle; frame `count` is the newest.

        It may take a number of frames that grows with the number of key frames, and then rests for as many (None: do
        not wait until it has rested).
        """
        count = self._rests_until if count is None else count
        if self._background.is_busy or not self._waiting or count < self._rests_until:
            return
        graph = SegmentGraph.of(self._map, self._segment_of(self._waiting[0]))
        mine = [found for found in self._waiting if self._segment_of(found) == graph.segment]
        self._waiting = [found for found in self._waiting if self._segment_of(found) != graph.segment]
        error = sensor.noise.calibration_error

        def work() -> _Closed:
            refusals = [contradiction(graph, found.edge, error) for found in mine]
            agreeing = [found.edge for found, refusal in zip(mine, refusals, strict=True) if not refusal]
            moves = graph.with_closures(agreeing).optimised() if agreeing else None
            return _Closed(graph, mine, refusals, moves)

        frames = TUNING.closing_frames + len(graph.numbers) // TUNING.closing_keyframes
        self._rests_until, self._merged = count + 2 * frames, []
        due_stamp = later(sensor.clock.steady, frames * _FRAME_S)
        self._background.start(count + frames, due_stamp, work)

    def take(self, count: int | None, stamp: SteadyStamp) -> list[LoopCandidate]:
        """Move the map by the result due at frame `count` (None: any result); return the candidates it decides.

        Each candidate was compared with the chain as it was before any of them. If its segment has been merged with
        another since, it waits once more.
        """
        closed = self._background.take(count, stamp)
        if closed is None:
            return []
        if self._is_stale:
            self._is_stale = False
            return []
        if any(self._segment_of(found) != closed.graph.segment for found in closed.found):
            self._waiting = [*closed.found, *self._waiting]
            return []
        if closed.moves is not None:
            closed.graph.take_over(self._map, closed.moves, self._merged)
        decided: list[LoopCandidate] = []
        for found, refusal in zip(closed.found, closed.refusals, strict=True):
            refusal = refusal or ("forgotten meanwhile" if self._is_forgotten(found.edge) else "")
            if refusal:
                decided.append(replace(found.candidate, accepted=False, reason=refusal))
                continue
            self._map.register(found.edge)
            add_old_landmarks(self._map, found)
            decided.append(found.candidate)
        return decided

    def _segment_of(self, found: ConfirmedCandidate) -> int:
        return self._map.keyframes[found.edge.b].segment

    def _is_forgotten(self, edge: Edge) -> bool:
        return any(n not in self._map.away and n not in self._map.remembered for n in (edge.a, edge.b))
