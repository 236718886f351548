"""Places seen again: each candidate is tracked, compared with the chain, and accepted or refused with a reason.

A candidate that would close a loop can wait: one at a time is tracked after a frame that has time left, and what is
confirmed is compared with the chain in the background (see `BackgroundClosing`).
"""

from collections.abc import Sequence
from dataclasses import replace

from odom.backend.estimate import LoopCandidate
from odom.backend.loop_closure.apart import KeptViews, recognised_apart
from odom.backend.loop_closure.background_closing import BackgroundClosing
from odom.backend.loop_closure.candidate import add_old_landmarks, refused_at_once, track_candidate
from odom.backend.loop_closure.closing import merge_segment
from odom.backend.loop_closure.tuning import TUNING
from odom.backend.map.map import Map
from odom.backend.mapping.described import DescribedKeyframe
from odom.backend.mapping.keyframe_inserter import KeyframeView
from odom.backend.tracking.frame_tracker import FrameTracker
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.matching.place_recognition import Recognition


class LoopCloser:
    """Judges the places that key frames of `map_` look like, closes loops and merges segments.

    A place goes from `_put_off` (not tracked yet) to `_closing` (confirmed by tracking) to the map; of a pose in doubt,
    a view is `_kept` for the end of the run.
    """

    def __init__(self, map_: Map, tracker: FrameTracker) -> None:
        self._map, self._tracker = map_, tracker
        self._put_off: list[DescribedKeyframe] = []
        """Each with those of its recognitions that have not been tracked yet."""
        self._closing = BackgroundClosing(map_)
        self._kept = KeptViews()

    @property
    def is_idle(self) -> bool:
        """Whether no loop is being closed in the background."""
        return not self._closing.is_busy

    def drop_waiting(self) -> None:
        """Forget candidates that wait: they were measured through another lens."""
        self._put_off = []
        self._closing.drop()

    def judge(self, described: Sequence[DescribedKeyframe], sensor: SensorModel) -> list[LoopCandidate]:
        """Track places of other segments that key frames look like; merge these segments and return what is decided.

        Places that the chain clearly contradicts are not tracked; those that would close a loop wait (see
        `work_on_waiting`).
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
                rest = self._track_first_place(rest, sensor, decided)
        return decided

    def work_on_waiting(self, count: int, sensor: SensorModel, has_time: bool) -> list[LoopCandidate]:
        """After frame `count - 1`, if it `has_time`, track a candidate that was put off, or begin to close loops.

        Returns the refused candidates. Where too many wait, one is tracked although there is no time.
        """
        decided: list[LoopCandidate] = []
        if has_time and not self._put_off:
            self._closing.start(count, sensor)
        while self._put_off and (has_time or len(self._put_off) > TUNING.most_put_off):
            self._track_next(sensor, decided)
            has_time = False
        return decided

    def close(self, count: int | None, sensor: SensorModel) -> list[LoopCandidate]:
        """Move the map by the closures due at frame `count` (None: all that wait); return what is decided."""
        decided = self._closing.take(count, sensor.clock.steady)
        while count is None and (self._put_off or self._closing.has_waiting):
            while self._put_off:
                self._track_next(sensor, decided)
            self._closing.start(None, sensor)
            decided += self._closing.take(None, sensor.clock.steady)
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

    def _track_next(self, sensor: SensorModel, decided: list[LoopCandidate]) -> None:
        rest = self._track_first_place(self._put_off.pop(0), sensor, decided)
        if rest.recognitions:
            self._put_off.insert(0, rest)

    def _track_first_place(
        self, one: DescribedKeyframe, sensor: SensorModel, decided: list[LoopCandidate]
    ) -> DescribedKeyframe:
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
            self._closing.add(found)
        else:
            self._closing.note_merged(merge_segment(self._map, found.edge))
            add_old_landmarks(self._map, found)
            decided.append(found.candidate)
        return True
