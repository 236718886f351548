"""Places seen again: each candidate is tracked, held against the chain, and accepted or refused with a reason.

What the chain says of a candidate, and how the map moves by those that agree with it, is worked out in the background:
in a large map that takes longer than a frame.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from odom.backend.estimate import LoopCandidate
from odom.backend.loop_closure.closing import merge_segment
from odom.backend.loop_closure.graph import Moves, SegmentGraph
from odom.backend.loop_closure.tuning import TUNING
from odom.backend.loop_closure.verification import contradiction
from odom.backend.map.keyframe import Observed
from odom.backend.map.map import Map
from odom.backend.map.memory import recall_near
from odom.backend.map.pose_graph import Edge
from odom.backend.mapping.background import Background
from odom.backend.mapping.described import DescribedKeyframe
from odom.backend.mapping.keyframe_inserter import KeyframeView
from odom.backend.tracking.frame_state import Tracked
from odom.backend.tracking.frame_tracker import FrameTracker
from odom.backend.tracking.quality import is_known_place
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.matching.place_recognition import Recognition
from odom.geometry import se3
from odom.geometry.arrays import Array

_FRAME_S = 1.0 / 30.0
"""Seconds in which a frame's worth of background work is done, however few frames come meanwhile."""


@dataclass(frozen=True, eq=False)
class _Found:
    """A `candidate` that geometry confirms: the registration, and what the key frame saw of old landmarks."""

    candidate: LoopCandidate
    edge: Edge
    uv: Array
    seen: Observed


@dataclass(frozen=True, eq=False)
class _Closed:
    """Candidates, each with why it is refused (empty: it is not), and the `moves` by those that are not, if any."""

    graph: SegmentGraph
    found: Sequence[_Found]
    refusals: Sequence[str]
    moves: Moves | None


class LoopCloser:
    """Judges the places that key frames of `map_` look like, closes loops and merges segments."""

    def __init__(self, map_: Map, tracker: FrameTracker) -> None:
        self._map, self._tracker = map_, tracker
        self._waiting: list[_Found] = []
        self._background = Background[_Closed]("closing")
        self._rests_until = 0
        self._merged: list[int] = []
        """Key frames that were merged with another segment since the background began."""

    @property
    def is_idle(self) -> bool:
        """Whether no loop is being closed in the background."""
        return not self._background.is_busy

    def drop_waiting(self) -> None:
        """Forget candidates that wait: they were measured through another lens."""
        self._waiting = []

    def judge(self, described: Iterable[DescribedKeyframe], sensor: SensorModel) -> list[LoopCandidate]:
        """Track what key frames look like; merge segments, and return what is decided already.

        What would close a loop waits: `close` holds it against the chain.
        """
        decided: list[LoopCandidate] = []
        for one in described:
            for recognition in one.recognitions:
                found = self._track(one.seen, recognition, sensor)
                if isinstance(found, LoopCandidate):
                    decided.append(found)
                    continue
                if found.edge.is_loop:
                    self._waiting = [*self._waiting, found][-TUNING.most_waiting :]
                else:
                    self._merged += merge_segment(self._map, found.edge)
                    self._add_old_landmarks(found)
                    decided.append(found.candidate)
                break
        return decided

    def close(self, count: int | None, sensor: SensorModel) -> list[LoopCandidate]:
        """Move the map by what is due at frame `count`, and begin with what waits (None: do all now).

        Returns what is decided by that.
        """
        decided = self._take(count, sensor.clock.steady)
        if count is not None:
            self._start(count, sensor)
            return decided
        while self._waiting:
            self._start(self._rests_until, sensor)
            decided += self._take(None, sensor.clock.steady)
        return decided

    def _start(self, count: int, sensor: SensorModel) -> None:
        """Begin to close what waits, of one segment, if idle and rested; frame `count` is the newest.

        How many frames that may take follows from how many key frames there are, and it rests for as many.
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
        """Move the map by what is due at frame `count` (None: whatever there is); return what is decided by that.

        Each candidate was held against the chain as it was before any of them. Where its segment has been merged with
        another since, it waits once more.
        """
        closed = self._background.take(count, stamp)
        if closed is None:
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
            self._add_old_landmarks(found)
            decided.append(found.candidate)
        return decided

    def _segment_of(self, found: _Found) -> int:
        return self._map.keyframes[found.edge.b].segment

    def _is_forgotten(self, edge: Edge) -> bool:
        return any(n not in self._map.away and n not in self._map.remembered for n in (edge.a, edge.b))

    def _track(self, seen: KeyframeView, recognition: Recognition, sensor: SensorModel) -> _Found | LoopCandidate:
        """Return a recognition that tracking confirms, with what it would do, or the candidate that is refused."""
        map_ = self._map
        keyframe, place = map_.keyframes[seen.keyframe], map_.keyframes[recognition.candidate]
        registration = recognition.registration
        inliers = 0 if registration is None else int(registration.inliers.sum())
        candidate = LoopCandidate(keyframe.stamp, place.stamp, inliers, False, recognition.refusal)
        if recognition.refusal or registration is None:
            return candidate
        T_start = se3.inverse(registration.T_target_source) @ place.T_camera_map
        recall_near(map_, place.number, T_start)
        tracked = track_place(map_, self._tracker, seen, place.number, T_start, sensor)
        T_place_keyframe = place.T_camera_map @ tracked.T_map_camera
        candidate = replace(candidate, inliers=tracked.found_again, T_candidate_current=T_place_keyframe)
        is_loop = place.segment == keyframe.segment
        if not is_known_place(tracked, must_agree_with_chain=is_loop):
            reason = f"only {tracked.found_again} of {tracked.visible_count} landmarks found again"
            return replace(candidate, reason=reason)
        covariance = tracked.covariance * sensor.noise.covariance_scale
        edge = Edge(place.number, keyframe.number, T_place_keyframe, covariance, is_loop)
        reason = f"{tracked.found_again} landmarks found again"
        reason = reason if is_loop else f"merges two segments: {reason}"
        old = tracked.inlying
        observed = Observed(
            rows=old.rows,
            identities=map_.landmarks.identity[old.rows].copy(),
            measurements=old.measurements,
            timing=sensor.timing,
        )
        return _Found(replace(candidate, accepted=True, reason=reason), edge, old.uv, observed)

    def _add_old_landmarks(self, found: _Found) -> None:
        """Add to a key frame the old landmarks that it was found to see: adjustments then join the loop by them.

        Those that were culled since, or that it has already, are left out.
        """
        landmarks, keyframe, seen = self._map.landmarks, self._map.keyframes[found.edge.b], found.seen
        self._map.journal.measure([keyframe.number])
        new = seen.current(landmarks) & ~np.isin(seen.identities, keyframe.identities[keyframe.current(landmarks)])
        keyframe.rows = np.concatenate([keyframe.rows, seen.rows[new]])
        keyframe.identities = np.concatenate([keyframe.identities, seen.identities[new]])
        keyframe.uv = np.concatenate([keyframe.uv, found.uv[new]])
        values = seen.measurements.take(new)
        change = keyframe.timing.vector - seen.timing.vector
        keyframe.measurements = keyframe.measurements.joined(replace(values, values=values.retimed(change)))


def track_place(
    map_: Map, tracker: FrameTracker, seen: KeyframeView, candidate: int, T_start: Array, sensor: SensorModel
) -> Tracked:
    """Return a key frame's view tracked against key frame `candidate` and those around it.

    Those that the key frame is linked with are left out: they saw its landmarks, or it saw theirs, in this very image.
    """
    known = map_.linked(seen.keyframe) - {candidate}
    local = tracker.around(candidate, T_start, known)
    return tracker.track(seen.view, sensor, T_start, seen.twist, local)
