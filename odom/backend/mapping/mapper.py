"""Keeping the map adjusted and bounded while it grows."""

from dataclasses import dataclass

import numpy as np

from odom.backend.map.frame_log import FrameLog
from odom.backend.map.lens_conversion import change_lens
from odom.backend.map.map import Map
from odom.backend.map.memory import expect_around, farthest_beyond, recall_near, set_aside
from odom.backend.map.pruning import forget, oldest_beyond
from odom.backend.mapping import map_adjustment
from odom.backend.mapping.background import Background
from odom.backend.mapping.bundle_adjustment import Bundle
from odom.backend.mapping.described import DescribedKeyframe, PlaceSearch
from odom.backend.mapping.intermediate_frames import IntermediateFrames
from odom.backend.mapping.keyframe_inserter import KeyframeInserter
from odom.backend.mapping.newer_keyframes import carry_newer, refit_newer
from odom.backend.mapping.row_motion import carry_misjudged, note_twists_around
from odom.backend.mapping.shutter_kind import ShutterKind
from odom.backend.mapping.tuning import TUNING
from odom.backend.settings import OdometrySettings
from odom.backend.tracking.posed_frame import PosedFrame
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.frontend.camera.lens import Lens
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import later
from odom.frontend.features.lens_change import LensChange
from odom.frontend.matching.place_recognition import GrownIndex
from odom.geometry import se3
from odom.geometry.arrays import Array, Index


@dataclass(frozen=True, eq=False)
class _Done:
    """What the background has made: an adjustment with its result, new key frames, and the index with their places.

    `change` is the change of lens that comes with it, None where the lens stays. `is_whole`: a segment was adjusted as
    a whole, not only its newest key frames. `shutter` is the kind that is believed now; where it is another one, the
    adjustment is by that kind.
    """

    adjustment: map_adjustment.Adjustment
    bundle: Bundle
    described: list[DescribedKeyframe]
    places: GrownIndex
    change: LensChange | None
    is_whole: bool
    shutter: ShutterKind


class Mapper:
    """Adjusts and prunes `map_`; its `inserter` adds key frames, `intermediate` keeps frames for the end.

    A `lens_to_come` replaces the sensor's with the next adjustment, which is then of a segment as a whole. So is the
    first adjustment after a tilt of depth was found, which has bent all measurements of the segment.
    `sensor` is what is known of the camera before anything is measured.
    """

    def __init__(self, map_: Map, settings: OdometrySettings, sensor: SensorModel) -> None:
        self._map, self._settings, self._shutter = map_, settings, ShutterKind.expected(sensor)
        self.inserter = KeyframeInserter(map_, settings)
        self.intermediate = IntermediateFrames()
        self._background = Background[_Done]("mapping")
        self._settled = map_.earlier_keyframes
        self.lens_to_come: Lens | None = None
        self._farthest: list[int] = []
        """Key frames that are set aside next, farthest first; as many as are chosen at once."""

    @property
    def is_idle(self) -> bool:
        """Whether nothing is adjusted in the background, so that the map may move."""
        return not self._background.is_busy

    def prune(self, last: PosedFrame | None) -> bool:
        """Forget the oldest key frames beyond `map_keyframes`; return whether there were any.

        Those around the camera and the newest ones, which are still worked on, are kept. Nothing is forgotten while
        the background works, since it reads the rest too. What is saved is set aside instead, the farthest first: it
        can be fetched again. `last` is None before the camera has a pose.
        """
        map_, most = self._map, self._settings.map_keyframes
        if self._background.is_busy or len(map_.remembered) <= most:
            return False
        if last is None:
            for number in map_.remembered[:-most]:
                set_aside(map_, number)
            return False
        around = map_.neighbours(last.reference, last.T_camera_map, self._settings.local_keyframes)
        newest = max(self._settings.window_keyframes, self._settings.background_delay_frames)
        needed = np.concatenate([around, [last.reference], map_.remembered[-newest:]])
        surplus = len(map_.remembered) - most
        if map_.journal.is_kept:
            self._set_aside(surplus, needed, last)
            return False
        if map_.details is not None:
            unsaved = np.array([n for n in map_.remembered if n >= map_.earlier_keyframes], dtype=np.int64)
            self._set_aside(surplus, np.union1d(needed, unsaved), last)
        oldest = oldest_beyond(map_, most, needed)
        for number in oldest:
            forget(map_, number)
        return bool(oldest)

    def _set_aside(self, surplus: int, needed: Index, last: PosedFrame) -> None:
        """Set aside `surplus` key frames, the farthest ones when that was last looked at, without those `needed`."""
        map_, most = self._map, self._settings.map_keyframes
        free = set(map_.remembered).difference(needed.tolist())
        waiting = [n for n in self._farthest if n in free]
        if len(waiting) < surplus:
            waiting = farthest_beyond(map_, most - TUNING.set_aside_ahead, needed, last.T_camera_map)
        for number in waiting[:surplus]:
            set_aside(map_, number)
        self._farthest = waiting[surplus:]

    def recall(self, last: PosedFrame) -> None:
        """Bring back a few key frames of a saved map that the camera comes near to, if there is room."""
        if len(self._map.remembered) <= self._settings.map_keyframes:
            recall_near(self._map, last.reference, last.T_camera_map, TUNING.recalled_at_once)

    def start_background(self, log: FrameLog, sensor: SensorModel, may_change: bool = False) -> None:
        """Begin to adjust the newest key frames and to describe their places, if idle; the `log` holds all frames.

        `may_change`: nothing else is at work that a new lens would make wrong.
        """
        is_whole = sensor.depth_tilt.is_new and len(self._map.members(self._map.keyframes[-1].segment)) >= 2
        lens = self.lens_to_come if may_change else None
        if self._background.is_busy or not (self.inserter.undescribed or is_whole or lens is not None):
            return
        change = None
        if lens is not None:
            change, self.lens_to_come, is_whole = LensChange(sensor.lens, lens), None, True
            sensor = sensor.with_lens(lens)
        newest = map_adjustment.window_of(self._map, self._settings.window_keyframes)
        note_twists_around(newest, log, self._map.keyframes, sensor.timing)
        adjustment = self._next_adjustment(sensor, is_whole, change)
        times = 1 + (len(adjustment.is_fixed) // TUNING.change_frames if is_whole else 0)
        searches = [PlaceSearch.of(self._map, seen) for seen in self.inserter.take_undescribed()]
        index, shutter = self._map.places.snapshot(), self._shutter
        window = self._settings.window_keyframes
        trials = [] if is_whole else shutter.trials(self._map, window, sensor)

        def work() -> _Done:
            believed, its_trial = shutter.tried(trials)
            adjusted, bundle = its_trial or (adjustment, adjustment.run())
            described = [search.run(index, sensor) for search in searches]
            expect_around(self._map, [r.candidate for one in described for r in one.recognitions if not r.refusal])
            grown = index.grown({d.seen.keyframe: d.place for d in described})
            return _Done(adjusted, bundle, described, grown, change, is_whole, believed)

        due_stamp = later(sensor.clock.steady, times * TUNING.background_s)
        self._background.start(log.count + times * self._settings.background_delay_frames, due_stamp, work)

    def _next_adjustment(
        self, sensor: SensorModel, is_whole: bool, change: LensChange | None
    ) -> map_adjustment.Adjustment:
        """Return the adjustment of the newest key frames, or of their segment if it `is_whole` or the lens changes."""
        segment, credit = self._map.keyframes[-1].segment, self._credit(sensor)
        if change is not None:
            return map_adjustment.everything_through(change, self._map, self.intermediate, segment, sensor, credit)
        if is_whole:
            return map_adjustment.everything(self._map, self.intermediate, segment, sensor, credit)
        return map_adjustment.newest(self._map, self._settings.window_keyframes, sensor, credit)

    def apply_background(
        self, count: int | None, sensor: SensorModel
    ) -> tuple[SensorModel, list[DescribedKeyframe]] | None:
        """Write the background's results into the map if they are due at frame `count` (None: at once).

        Returns the sensor with the timing adjusted, and the new lens if there is one, and the key frames that can be
        recognised from now on; None where nothing was due and the map is as it was.
        """
        taken = self._background.take(count, sensor.clock.steady)
        if taken is None:
            return None
        change, adjustment, bundle = taken.change, taken.adjustment, taken.bundle
        newest = self._map.keyframes[int(adjustment.numbers[-1])]
        T_newest_map = newest.T_camera_map
        if change is not None:
            change_lens(self._map, change)
            self.inserter.change_lens(change)
            self.intermediate.change_lens(change)
            sensor = sensor.with_lens(change.after)
        is_other_kind = taken.shutter.beforehand is not self._shutter.beforehand
        if is_other_kind:
            sensor = sensor.with_timing_of(taken.shutter.beforehand)
            self.inserter.want_keyframe()
        sensor = self._take_over(adjustment, bundle, sensor, self._credit(sensor))
        self._shutter = taken.shutter
        carry_newer(self._map, newest, se3.inverse(T_newest_map) @ newest.T_camera_map)
        if taken.is_whole or is_other_kind:
            refit_newer(self._map, newest, sensor.timing, sensor.depth_tilt.angles)
            self.intermediate.move(adjustment.poses_between(bundle), self._map.keyframes)
        self._map.places.adopt(taken.places)
        self._note_measured([one.seen.keyframe for one in taken.described])
        return sensor, taken.described

    def keep(self, number: int, tracked: TrackedFrame, sensor: SensorModel) -> None:
        """Keep what the tracked frame `number` measured, for `finish`."""
        self.intermediate.add(number, tracked, self._map.keyframes, self._map.landmarks, sensor.timing)

    def finish(self, sensor: SensorModel, log: FrameLog) -> tuple[SensorModel, dict[int, Array]]:
        """Adjust each segment as a whole, as far as it is remembered; `log` holds all frames.

        Returns the sensor with timing and tilt adjusted, and T_camera_map of the intermediate frames that were adjusted
        too, by their numbers. The prior of timing and tilt is what was known before the run: what the run has shown
        since was measured by the same frames, which would count twice. It is only where the adjustment starts.
        """
        adjusted: dict[int, Array] = {}
        self._carry_misjudged(sensor, log)
        known, sensor = sensor, sensor.as_known_before(self._shutter.beforehand)
        mine = [n for n in self._map.remembered if n >= self._map.earlier_keyframes]
        for segment in sorted({self._map.keyframes[n].segment for n in mine}):
            if len(self._map.members(segment)) >= 2:
                credit = 1.0 / sensor.noise.covariance_scale
                adjustment = map_adjustment.everything(self._map, self.intermediate, segment, sensor, credit)
                bundle = adjustment.started_at(sensor.change_to(known)).run()
                known = sensor = self._take_over(adjustment, bundle, sensor, credit)
                adjusted |= adjustment.poses_between(bundle)
        self._map.journal.note_new_details([*mine, *self._map.journal.with_fewer_landmarks])
        return sensor, adjusted

    def _carry_misjudged(self, sensor: SensorModel, log: FrameLog) -> None:
        """Carry anew what frames measured by a readout that was far off (see `row_motion`)."""
        keyframes = [self._map.keyframes[n] for n in self._map.remembered if n >= self._map.earlier_keyframes]
        between = [one for one in self.intermediate.kept if one.number >= log.dropped]
        numbers = [k.frame for k in keyframes] + [one.number for one in between]
        poses = np.array([k.T_camera_map for k in keyframes] + [one.pose(self._map.keyframes) for one in between])
        carry_misjudged([*keyframes, *between], numbers, poses, self._map, log, sensor)

    def _note_measured(self, described: list[int]) -> None:
        """Note in the journal which key frames have their places now, and which will not be adjusted any more."""
        settled = [n for n in self._map.remembered[: -self._settings.window_keyframes] if n >= self._settled]
        self._settled = max(settled, default=self._settled - 1) + 1
        self._map.journal.note_new_details([*described, *settled])

    def _take_over(
        self, adjustment: map_adjustment.Adjustment, bundle: Bundle, sensor: SensorModel, credit: float
    ) -> SensorModel:
        map_adjustment.take_over(self._map, adjustment, bundle)
        if np.abs(bundle.timing_change[: len(sensor.timing.vector)]).max() > TUNING.timing_settled_s:
            self.inserter.want_keyframe()  # only key frames tell more of it, and what is in view may last for long
        return sensor.with_adjusted(bundle.timing_change, bundle.information_timing, bundle.pull_timing, credit)

    def _credit(self, sensor: SensorModel) -> float:
        """Return which share of an adjustment's information on the timing counts.

        A key frame is adjusted many times while it is in the window, and errs by more than its covariance says, as the
        noise monitor shows.
        """
        return 1.0 / (self._settings.window_keyframes * sensor.noise.covariance_scale)
