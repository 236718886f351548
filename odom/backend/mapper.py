"""Growing and correcting the map: key frames, adjustment and place recognition in the background, loop closure."""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odom.backend import window
from odom.backend.bundle import Bundle
from odom.backend.closing import Recognition, close_loop, contradiction, merge_segment, recognise
from odom.backend.estimate import LoopCandidate
from odom.backend.forgetting import forget, oldest_beyond
from odom.backend.graph import Edge
from odom.backend.keyframes import Keyframe
from odom.backend.map import Map
from odom.backend.selfcheck import SelfCheck
from odom.backend.settings import OdometrySettings
from odom.backend.sightings import Sightings
from odom.backend.tracking import Before, Tracked, track
from odom.frame import Camera
from odom.frontend.corners import detect_corners
from odom.frontend.lens import Lens
from odom.frontend.measure import FeatureNoise, Measurements, measure
from odom.frontend.places import Place, PlaceIndex, describe_place
from odom.frontend.timing import Timing
from odom.frontend.view import View
from odom.registration import se3

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_FARTHEST_M = 8.0
_TIMING_FORGET = 0.95
LEAST_FOUND_AGAIN = 30
_SHARE_IN_CHAIN, _SHARE_WITHOUT_CHAIN = 0.2, 0.35
"""Of the landmarks looked for, what must be found again: less where the chain of key frames agrees as well."""
_NO_ROWS = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Seen:
    """A key frame's own view, kept while it is worked on, and the `twist` it was measured with."""

    keyframe: int
    view: View
    twist: Array


@dataclass(frozen=True, eq=False)
class _Task:
    due: int
    adjustment: window.Adjustment
    result: Future[tuple[Bundle, list[tuple[Seen, Place, list[Recognition]]]]]


class Mapper:
    """Owns the map. What runs in the background takes effect at a fixed frame number, so that repeats are equal."""

    def __init__(self, camera: Camera, lens: Lens, settings: OdometrySettings) -> None:
        self.map, self.index = Map(), PlaceIndex()
        self.sightings = Sightings()
        self._camera, self.lens, self._settings = camera, lens, settings
        self.timing = Timing(settings.readout_prior_s, settings.depth_lag_prior_s, settings.depth_readout_prior_s)
        self._timing_information = np.diag(
            [
                settings.readout_prior_sigma_s**-2.0,
                settings.depth_lag_prior_sigma_s**-2.0,
                settings.depth_readout_prior_sigma_s**-2.0,
            ]
        )
        self._waiting: list[Seen] = []
        self._recognitions: list[tuple[Seen, list[Recognition]]] = []
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="odom-background")
        self._task: _Task | None = None

    def track(
        self,
        view: View,
        T_start: Array,
        twist: Array,
        near: int,
        noise: FeatureNoise,
        before: Before | None = None,
    ) -> Tracked:
        """Return `view` tracked against the key frames around `near` (see `tracking.track`)."""
        local = self.map.neighbours(near, T_start, self._settings.local_keyframes)
        return self.track_against(local, view, T_start, twist, noise, before)

    def track_against(
        self,
        local: Index,
        view: View,
        T_start: Array,
        twist: Array,
        noise: FeatureNoise,
        before: Before | None = None,
    ) -> Tracked:
        """Return `view` tracked against the key frames `local` and no others."""
        return track(
            self.map, view, self._camera, self.lens, T_start, twist, local, self.timing, noise, self._settings, before
        )

    def is_known_place(self, tracked: Tracked) -> bool:
        """Say whether a frame without any chain to it shows what its key frames saw."""
        return tracked.found_again >= max(LEAST_FOUND_AGAIN, _SHARE_WITHOUT_CHAIN * tracked.looked_for)

    def add_keyframe(
        self,
        view: View,
        T_camera_map: Array,
        twist: Array,
        rows: Index,
        uv: Array,
        measurements: Measurements | None,
        check: SelfCheck,
        segment: int,
        against: int | None,
        covariance: Array,
    ) -> Keyframe:
        """Make a key frame of a frame that measured landmarks `rows` at `uv`; new corners become landmarks."""
        corners = detect_corners(view.images.full, uv, self._settings.cell_px)
        measured = self._measured(view, corners, twist, check)
        usable = measured.values[:, 2] > 1.0 / _FARTHEST_M
        keyframe = self.map.add_keyframe(
            view.stamp,
            segment,
            T_camera_map,
            view.images,
            rows,
            uv,
            measured.take(_NO_ROWS) if measurements is None else measurements,
            corners[usable],
            measured.take(usable),
            self.timing,
            against,
            covariance,
        )
        self.map.cull(self.map.neighbours(keyframe.number, T_camera_map, self._settings.local_keyframes))
        self._waiting.append(Seen(keyframe.number, view, twist))
        del self._waiting[: -self._settings.background_delay_frames]
        return keyframe

    def remeasure(self, number: int, view: View, twist: Array, check: SelfCheck) -> None:
        """Measure a key frame's features once more, now that its motion is known better."""
        keyframe = self.map.keyframes[number]
        self.map.remeasure(keyframe, self._measured(view, keyframe.uv, twist, check), self.timing)

    def _measured(self, view: View, uv: Array, twist: Array, check: SelfCheck) -> Measurements:
        no_covariance = np.zeros((len(uv), 3))
        return measure(view.frame, self.lens, uv, no_covariance, twist, self.timing, check.noise)

    @property
    def forgotten(self) -> int:
        """How many key frames were forgotten."""
        return len(self.map.keyframes) - len(self.map.remembered)

    def forget(self, near: int, T_camera_map: Array) -> bool:
        """Forget the oldest key frames beyond `map_keyframes`; say whether there were any.

        Never those around the pose `T_camera_map` near key frame `near`, nor the newest, which are still worked on: the
        background reads the rest too, so nothing is forgotten while it works.
        """
        if self._task is not None or len(self.map.remembered) <= self._settings.map_keyframes:
            return False
        around = self.map.neighbours(near, T_camera_map, self._settings.local_keyframes)
        newest = max(self._settings.window_keyframes, self._settings.background_delay_frames)
        needed = np.concatenate([around, [near], self.map.remembered[-newest:]])
        oldest = oldest_beyond(self.map, self._settings.map_keyframes, needed)
        for number in oldest:
            forget(self.map, number)
            self.index.forget(number)
        return bool(oldest)

    def start_background(self, count: int, check: SelfCheck) -> None:
        """Begin with what waits for the background, if it is idle; frame `count` is the newest."""
        if self._task is not None or not self._waiting:
            return
        prior = self._timing_information / self._credit(check)
        adjustment = window.newest(self.map, self._settings.window_keyframes, self.timing, prior)
        waiting, self._waiting = self._waiting, []
        linked = [self._linked(seen.keyframe) for seen in waiting]
        timing, lens, index, noise = self.timing, self.lens, self.index, check.noise

        def work() -> tuple[Bundle, list[tuple[Seen, Place, list[Recognition]]]]:
            bundle = adjustment.run()
            found = []
            for seen, excluded in zip(waiting, linked, strict=True):
                place = describe_place(seen.view, lens, seen.twist, timing, noise)
                found.append((seen, place, recognise(index, place, excluded)))
            return bundle, found

        due = count + self._settings.background_delay_frames
        self._task = _Task(due, adjustment, self._pool.submit(work))

    def _linked(self, number: int) -> set[int]:
        """Return the key frames that `number` needs no closure with: linked over two hops, itself included."""
        near = self.map.links[number] | {number}
        return near.union(*(self.map.links[k] for k in near))

    def take_adjustment(self, count: int | None, check: SelfCheck) -> bool:
        """Take over the background's work if it is due at frame `count` (None: at once); say whether the map moved."""
        if self._task is None or (count is not None and count < self._task.due):
            return False
        task, self._task = self._task, None
        bundle, found = task.result.result()
        self._take_over(task.adjustment, bundle, check)
        for seen, place, recognitions in found:
            self.index.add(seen.keyframe, place)
            self._recognitions.append((seen, recognitions))
        return True

    def _credit(self, check: SelfCheck) -> float:
        """Return how much of an adjustment's information on the timing to believe.

        A key frame is adjusted time and again while it is in the window, and errs as the self-check says.
        """
        return 1.0 / (self._settings.window_keyframes * check.scale)

    def _take_over(self, adjustment: window.Adjustment, bundle: Bundle, check: SelfCheck) -> None:
        window.take_over(self.map, adjustment, bundle)
        self.timing = self.timing.changed(bundle.timing_change)
        if bundle.information_timing is not None:
            self._timing_information = (
                _TIMING_FORGET * self._timing_information + self._credit(check) * bundle.information_timing
            )

    def take_recognitions(self, check: SelfCheck) -> tuple[LoopCandidate, ...]:
        """Judge the places recognised since, act on those that hold; return all with their decisions and reasons."""
        waiting, self._recognitions = self._recognitions, []
        candidates: list[LoopCandidate] = []
        for seen, recognitions in waiting:
            for recognition in recognitions:
                candidates.append(self._judge(seen, recognition, check))
                if candidates[-1].accepted:
                    break
        return tuple(candidates)

    def _judge(self, seen: Seen, recognition: Recognition, check: SelfCheck) -> LoopCandidate:
        keyframe = self.map.keyframes[seen.keyframe]
        candidate = self.map.keyframes[recognition.candidate]
        registration = recognition.registration
        inliers = 0 if registration is None else int(registration.inliers.sum())
        verdict = LoopCandidate(keyframe.stamp, candidate.stamp, inliers, False, recognition.refusal)
        if recognition.refusal or registration is None:
            return verdict
        T_start = se3.inverse(registration.T_target_source) @ candidate.T_camera_map
        tracked = self.track(seen.view, T_start, seen.twist, candidate.number, check.noise)
        found = tracked.found_again
        T_candidate_keyframe = candidate.T_camera_map @ se3.inverse(tracked.T_camera_map)
        verdict = replace(verdict, inliers=found, T_candidate_current=T_candidate_keyframe)
        share = _SHARE_IN_CHAIN if candidate.segment == keyframe.segment else _SHARE_WITHOUT_CHAIN
        if found < max(LEAST_FOUND_AGAIN, share * tracked.looked_for):
            return replace(verdict, reason=f"only {found} of {tracked.looked_for} landmarks found again")
        edge = Edge(candidate.number, keyframe.number, T_candidate_keyframe, tracked.covariance * check.scale)
        if candidate.segment != keyframe.segment:
            merge_segment(self.map, edge)
            reason = f"merges two segments: {found} landmarks found again"
        else:
            refusal = contradiction(self.map, edge, check.calibration_error)
            if refusal:
                return replace(verdict, reason=refusal)
            close_loop(self.map, replace(edge, is_loop=True))
            reason = f"{found} landmarks found again"
        self._remember_sighting(keyframe, tracked)
        return replace(verdict, accepted=True, reason=reason)

    def _remember_sighting(self, keyframe: Keyframe, tracked: Tracked) -> None:
        """Let a key frame hold the old landmarks that it was found to see: the adjustment joins the loop by them."""
        new = tracked.inliers & ~np.isin(tracked.rows, keyframe.rows[keyframe.current(self.map.landmarks)])
        rows = tracked.rows[new]
        keyframe.rows = np.concatenate([keyframe.rows, rows])
        keyframe.identities = np.concatenate([keyframe.identities, self.map.landmarks.identity[rows]])
        keyframe.uv = np.concatenate([keyframe.uv, tracked.uv[new]])
        values = tracked.measurements.take(new)
        change = keyframe.timing.vector - self.timing.vector
        keyframe.measurements = keyframe.measurements.joined(replace(values, values=values.retimed(change)))

    def sight(self, number: int, tracked: Tracked) -> None:
        """Take note of what the tracked frame `number` measured, for `finish`."""
        self.sightings.add(number, tracked, self.map.keyframes, self.map.landmarks, self.timing)

    def finish(self, check: SelfCheck) -> dict[int, Array]:
        """Adjust each segment as a whole, as far as it is remembered.

        Returns T_camera_map of the frames that were adjusted with the key frames, by their numbers.
        """
        adjusted: dict[int, Array] = {}
        for segment in sorted({self.map.keyframes[n].segment for n in self.map.remembered}):
            if len(self.map.members(segment)) >= 2:
                prior = self._timing_information / self._credit(check)
                adjustment = window.everything(self.map, self.sightings, segment, self.timing, prior)
                bundle = adjustment.run()
                self._take_over(adjustment, bundle, check)
                poses = bundle.T_camera_map[len(adjustment.numbers) :]
                adjusted |= zip(adjustment.between.tolist(), poses, strict=True)
        return adjusted
