"""Growing the map, and keeping it adjusted and bounded."""

import numpy as np
from numpy.typing import NDArray

from odom.backend import window
from odom.backend.background import Background, Described, Seen
from odom.backend.bundle import Bundle
from odom.backend.closing import recognise
from odom.backend.forgetting import forget, oldest_beyond
from odom.backend.keyframes import Keyframe, Measured
from odom.backend.map import Map
from odom.backend.selfcheck import SelfCheck
from odom.backend.settings import OdometrySettings
from odom.backend.sightings import Sightings
from odom.backend.timing_estimate import TimingEstimate
from odom.backend.tracking import Before, Tracked, track
from odom.frame import Camera
from odom.frontend.corners import detect_corners
from odom.frontend.lens import Lens
from odom.frontend.measure import FeatureNoise, Measurements, measure
from odom.frontend.places import PlaceIndex, describe_place
from odom.frontend.timing import Timing
from odom.frontend.view import View

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_FARTHEST_M = 8.0


class Mapper:
    """Owns the map, the index of places and the timing, and what works on them."""

    def __init__(self, camera: Camera, lens: Lens, settings: OdometrySettings) -> None:
        self.map, self.index = Map(), PlaceIndex()
        self.sightings = Sightings()
        self._camera, self.lens, self._settings = camera, lens, settings
        self._timing = TimingEstimate.of(settings)
        self._waiting: list[Seen] = []
        self._background = Background(settings.background_delay_frames)

    @property
    def timing(self) -> Timing:
        """The sensor's timing as estimated so far."""
        return self._timing.timing

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

    def track_place(self, seen: Seen, candidate: int, T_start: Array, noise: FeatureNoise) -> Tracked:
        """Return a key frame's view tracked against key frame `candidate` and those around it.

        Those that the key frame is linked with anyway are left out: they know it, or it knows them, by this very image.
        """
        known = self.map.linked(seen.keyframe) - {candidate}
        local = self.map.neighbours(candidate, T_start, self._settings.local_keyframes, known)
        return self.track_against(local, seen.view, T_start, seen.twist, noise)

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

    def add_keyframe(
        self,
        view: View,
        T_camera_map: Array,
        twist: Array,
        known: Measured,
        check: SelfCheck,
        segment: int,
        against: int | None,
        covariance: Array,
    ) -> Keyframe:
        """Make a key frame of a frame that measured landmarks already `known`; new corners become landmarks."""
        corners = detect_corners(view.images.full, known.uv, self._settings.cell_px)
        measured = self._measured(view, corners, twist, check)
        usable = measured.values[:, 2] > 1.0 / _FARTHEST_M
        keyframe = self.map.add_keyframe(
            view.stamp,
            segment,
            T_camera_map,
            view.images,
            known,
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
        return len(self.map.forgotten)

    def forget(self, near: int, T_camera_map: Array) -> bool:
        """Forget the oldest key frames beyond `map_keyframes`; say whether there were any.

        Never those around the pose `T_camera_map` near key frame `near`, nor the newest, which are still worked on: the
        background reads the rest too, so nothing is forgotten while it works.
        """
        if self._background.is_busy or len(self.map.remembered) <= self._settings.map_keyframes:
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
        if self._background.is_busy or not self._waiting:
            return
        prior = self._timing.information / self._credit(check)
        adjustment = window.newest(self.map, self._settings.window_keyframes, self.timing, prior)
        waiting, self._waiting = self._waiting, []
        linked = [self.map.linked(seen.keyframe) for seen in waiting]
        timing, lens, index, noise = self.timing, self.lens, self.index, check.noise

        def describe() -> list[Described]:
            places = [describe_place(seen.view, lens, seen.twist, timing, noise) for seen in waiting]
            return [
                Described(seen, place, recognise(index, place, excluded))
                for seen, place, excluded in zip(waiting, places, linked, strict=True)
            ]

        self._background.start(count, adjustment, describe)

    def take_background(self, count: int | None, check: SelfCheck) -> list[Described] | None:
        """Take over the background's work if it is due at frame `count` (None: at once).

        Returns the key frames that can be recognised from now on; None where nothing was due and the map is as it was.
        """
        taken = self._background.take(count)
        if taken is None:
            return None
        adjustment, bundle, described = taken
        self._take_over(adjustment, bundle, check)
        for one in described:
            self.index.add(one.seen.keyframe, one.place)
        return described

    def _credit(self, check: SelfCheck) -> float:
        """Return how much of an adjustment's information on the timing to believe.

        A key frame is adjusted time and again while it is in the window, and errs as the self-check says.
        """
        return 1.0 / (self._settings.window_keyframes * check.scale)

    def _take_over(self, adjustment: window.Adjustment, bundle: Bundle, check: SelfCheck) -> None:
        window.take_over(self.map, adjustment, bundle)
        self._timing = self._timing.after(bundle, self._credit(check))

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
                prior = self._timing.information / self._credit(check)
                adjustment = window.everything(self.map, self.sightings, segment, self.timing, prior)
                bundle = adjustment.run()
                self._take_over(adjustment, bundle, check)
                poses = bundle.T_camera_map[len(adjustment.numbers) :]
                adjusted |= zip(adjustment.between.tolist(), poses, strict=True)
        return adjusted
