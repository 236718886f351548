"""Places seen again: each candidate is tracked, compared with the chain, and accepted or refused with a reason.

Candidates are compared with the chain, and the motion of the map is computed, in the background: in a large map that
takes longer than a frame. A candidate that would close a loop can wait: one at a time is tracked after a frame that has
time left.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from odom.backend.estimate import LoopCandidate
from odom.backend.loop_closure.apart import KeptViews, recognised_apart
from odom.backend.loop_closure.candidate import ConfirmedCandidate, add_old_landmarks, refused_at_once, track_candidate
from odom.backend.loop_closure.closing import merge_segment
from odom.backend.loop_closure.graph import Moves, SegmentGraph
from odom.backend.loop_closure.tuning import TUNING
from odom.backend.loop_closure.verification import contradiction
from odom.backend.map.map import Map
from odom.backend.map.pose_graph import Edge
from odom.backend.mapping.background import Background
from odom.backend.mapping.described import DescribedKeyframe
from odom.backend.mapping.keyframe_inserter import KeyframeView
from odom.backend.tracking.frame_tracker import FrameTracker
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.matching.place_recognition import Recognition

_FRAME_S = 1.0 / 30.0
"""Seconds in which a frame's worth of background work is done, however few frames come meanwhile."""


@dataclass(frozen=True, eq=False)
class _Closed:
    """Candidates, each with the reason to refuse it (empty: accepted), and the `moves` by the accepted ones, if any."""

    graph: SegmentGraph
    found: Sequence[ConfirmedCandidate]
    refusals: Sequence[str]
    moves: Moves | None


class LoopCloser:
    """Judges the places that key frames of `map_` look like, closes loops and merges segments."""

    def __init__(self, map_: Map, tracker: FrameTracker) -> None:
        self._map, self._tracker = map_, tracker
        self._put_off: list[DescribedKeyframe] = []
        """Each with those of its recognitions that have not been tracked yet."""
        self._waiting: list[ConfirmedCandidate] = []
        self._background = Background[_Closed]("closing")
        self._is_stale = False
        """Whether the result of the background is to be dropped."""
        self._rests_until = 0
        self._merged: list[int] = []
        """Key frames that were merged with another segment since the background began."""
        self._kept = KeptViews()

    @property
    def is_idle(self) -> bool:
        """Whether no loop is being closed in the background."""
        return not self._background.is_busy

    def drop_waiting(self) -> None:
        """Forget candidates that wait: they were measured through another lens."""
        self._put_off, self._waiting = [], []
        self._is_stale = self._background.is_busy

    def judge(self, described: Sequence[DescribedKeyframe], sensor: SensorModel) -> list[LoopCandidate]:
        """Track places of other segments that key frames look like; merge these segments and return what is decided.

        Places that the chain clearly contradicts are not tracked. Places that would close a loop wait (see `look`).
        """
        decided: list[LoopCandidate] = []
        self._kept = self._kept.with_more(one.seen for one in described)
        for one in described:
            likely: list[Recognition] = []
            for recognition in one.recognitions:
                refused = refused_at_once(self._map, one.seen.keyframe, recognition, sensor.noise)
                if refused is None:
                    likely.append(recognition)
                else:
                    decided.append(refused)
            rest = replace(one, recognitions=likely)
            segment = self._map.keyframes[one.seen.keyframe].segment
            if likely and all(self._map.keyframes[r.candidate].segment == segment for r in likely):
                self._put_off.append(rest)
                continue
            while rest.recognitions:
                rest = self._look_at(rest, sensor, decided)
        return decided

    def look(self, count: int, sensor: SensorModel, has_time: bool) -> list[LoopCandidate]:
        """After frame `count - 1`, if it `has_time`, track a candidate that was put off, or begin to close loops.

        Returns the refused candidates. Where too many wait, one is tracked although there is no time.
        """
        decided: list[LoopCandidate] = []
        if has_time and not self._put_off:
            self._start(count, sensor)
        while self._put_off and (has_time or len(self._put_off) > TUNING.most_put_off):
            self._look_at_next(sensor, decided)
            has_time = False
        return decided

    def close(self, count: int | None, sensor: SensorModel) -> list[LoopCandidate]:
        """Move the map by the closures due at frame `count` (None: all that wait); return what is decided."""
        decided = self._take(count, sensor.clock.steady)
        while count is None and (self._put_off or self._waiting):
            while self._put_off:
                self._look_at_next(sensor, decided)
            self._start(self._rests_until, sensor)
            decided += self._take(None, sensor.clock.steady)
        if count is None:
            self._join_segments(sensor, decided)
        return decided

    def _join_segments(self, sensor: SensorModel, decided: list[LoopCandidate]) -> None:
        """When a run ends, track once what the kept views show of other segments, and merge these.

        Each outcome is added to `decided`.
        """
        views, self._kept = self._kept.views, KeptViews()
        for seen, recognition in recognised_apart(self._map, views):
            ends = self._map.keyframes[seen.keyframe], self._map.keyframes[recognition.candidate]
            if ends[0].segment != ends[1].segment:
                self._try_place(seen, recognition, sensor, decided)

    def _look_at_next(self, sensor: SensorModel, decided: list[LoopCandidate]) -> None:
        rest = self._look_at(self._put_off.pop(0), sensor, decided)
        if rest.recognitions:
            self._put_off.insert(0, rest)

    def _look_at(self, one: DescribedKeyframe, sensor: SensorModel, decided: list[LoopCandidate]) -> DescribedKeyframe:
        """Track the first of the places that a key frame looks like, and add the outcome to `decided`.

        Returns the key frame with the remaining places, with none if the first one was right.
        """
        first, *others = one.recognitions
        is_found = self._try_place(one.seen, first, sensor, decided)
        return replace(one, recognitions=[] if is_found else others)

    def _try_place(
        self, seen: KeyframeView, place: Recognition, sensor: SensorModel, decided: list[LoopCandidate]
    ) -> bool:
        """Track a place that a key frame looks like; return whether it is that place, and add to `decided`.

        If it is, segments are merged at once, while a loop waits to be closed.
        """
        found = track_candidate(self._map, self._tracker, seen, place, sensor)
        if isinstance(found, LoopCandidate):
            decided.append(found)
            return False
        if found.edge.is_loop:
            self._waiting = [*self._waiting, found][-TUNING.most_waiting :]
        else:
            self._merged += merge_segment(self._map, found.edge)
            add_old_landmarks(self._map, found)
            decided.append(found.candidate)
        return True

    def _start(self, count: int, sensor: SensorModel) -> None:
        """Begin to close the waiting loops of one segment, if idle and rested; frame `count` is the newest.

        It may take a number of frames that grows with the number of key frames, and then rests for as many.
        """
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
        due_stamp = SteadyStamp(sensor.clock.steady + round(frames * _FRAME_S * 1e9))
        self._background.start(count + frames, due_stamp, work)

    def _take(self, count: int | None, stamp: SteadyStamp) -> list[LoopCandidate]:
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
