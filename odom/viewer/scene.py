"""From wire messages to Rerun entities: no I/O, bounded memory, the same messages give the same picture."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np
import rerun as rr

from odom.evaluation import Trajectory
from odom.frame import Stamp
from odom.viewer import entities, palette
from odom.viewer.clouds import Cloud
from odom.viewer.draw import Draw, draw
from odom.viewer.images import Images
from odom.viewer.map_scene import MapScene, trajectory, truth_line
from odom.viewer.settings import ViewerSettings
from odom.viewer.trail import Trail
from odom.viewer.truth import Comparison, ProgressiveCalibration, TruthInMap, align_truth, in_map, three_sigma
from odom.viewer.words import INFO, Words, says
from odom.wire import Message, Topics, codec, truth_body

_REFRESH_NS = 1_000_000_000
_JUDGE_NS = 200_000_000
_RESTART_NS = 5_000_000_000
_TRUTH_BODIES = 8
_CAMERA_BODY = "camera"

_SERIES: tuple[tuple[str, tuple[str, ...], tuple[tuple[int, ...], ...]], ...] = (
    (entities.POSITION_ERROR, ("error", "3 sigma"), (palette.CORRECTED, palette.BOUND)),
    (entities.ROTATION_ERROR, ("error", "3 sigma"), (palette.CORRECTED, palette.BOUND)),
    (entities.INLIERS, ("inliers", "matches"), (palette.GOOD, palette.BOUND)),
    (entities.TIMES, ("processing", "latency"), (palette.CORRECTED, palette.ONLINE)),
)


class Scene:
    """Everything the viewer shows of one device.

    `handle` takes the messages in the order of their arrival; it raises WireError for one that cannot be decoded and
    is then as it was before. Messages of other topics are ignored.
    """

    def __init__(self, topics: Topics, settings: ViewerSettings) -> None:
        self._topics = topics
        self._settings = settings
        self._begin()
        self._handlers: Mapping[str, Callable[[Message], Iterator[Draw]]] = {
            topics.camera_info: lambda message: self._images.camera_info(message),
            topics.color: self._color,
            topics.color_compressed: self._color,
            topics.depth: lambda message: self._images.depth(message),
            topics.depth_compressed: lambda message: self._images.depth(message),
            topics.features: lambda message: self._images.features(message),
            topics.landmarks: self._landmarks,
            topics.keyframes: self._keyframe,
            topics.odom: self._odometry,
            topics.pose: self._pose,
            topics.path: self._path,
            topics.loops: self._loop,
            topics.status: self._status,
            topics.end: self._end,
        }

    def _begin(self) -> None:
        self._images = Images(self._settings.jpeg_quality)
        self._map = MapScene(self._settings)
        self._words = Words()
        self._truth: dict[str, Trail] = {}
        self._comparison = Comparison()
        self._calibration = ProgressiveCalibration()
        self._fit: TruthInMap | None = None
        self._segment: tuple[str | None, Stamp] = (None, Stamp(0))
        self._bounds: tuple[Stamp, float, float] = (Stamp(0), np.nan, np.nan)
        self._newest: Stamp | None = None
        self._refreshed: Stamp | None = None
        self._judged_at: Stamp | None = None

    def setup(self) -> Iterator[Draw]:
        """Yield what never changes: axes and the styles of the plots."""
        yield from self._map.setup()
        for path, names, colors in _SERIES:
            yield draw(path, None, rr.SeriesLines(names=names, colors=colors, widths=[1.8, 1.2]))

    def handle(self, message: Message) -> Iterator[Draw]:
        """Yield what a message changes."""
        topic = message.topic
        if handler := self._handlers.get(topic):
            yield from handler(message)
        elif (body := truth_body(topic)) is not None:
            self._add_truth(body, message)

    def history(self, message: Message) -> None:
        """Take a path of the time before this viewer started: `<ns>/history/odom` or `truth/<body>/history`."""
        poses = codec.decode_path(message)
        if not poses:
            return
        if (body := truth_body(message.topic)) is not None:
            trail = self._trail(body)
        else:
            trail = self._map.online
            self._newest = max(self._newest or poses[-1].stamp, poses[-1].stamp)
        if trail is not None:
            trail.prepend(trajectory(poses))

    def everything(self) -> Iterator[Draw]:
        """Yield all that is static or slow once more, for browsers that open the page when the rest is forgotten."""
        if self._newest is not None:
            yield from self._map.all_points(self._newest)
            yield from self._refresh(self._newest)

    def _color(self, message: Message) -> Iterator[Draw]:
        if self._newest is None:
            self._newest = message.stamp
        yield from self._images.color(message)

    def _keyframe(self, message: Message) -> Iterator[Draw]:
        yield from self._map.cloud(message.stamp, Cloud(*codec.decode_cloud(message)))

    def _landmarks(self, message: Message) -> Iterator[Draw]:
        yield from self._map.landmarks(message.stamp, codec.decode_points(message))

    def _odometry(self, message: Message) -> Iterator[Draw]:
        pose = codec.decode_odometry(message)
        if self._newest is not None and pose.stamp < self._newest - _RESTART_NS:
            self._begin()
            yield says(pose.stamp, INFO, "The time went back: a new run begins")
        self._newest = pose.stamp
        self._words.frame(pose.stamp)
        if pose.covariance is not None:
            self._bounds = (pose.stamp, *three_sigma(pose.covariance))
        yield from self._map.odometry(pose)
        if self._refreshed is None or pose.stamp - self._refreshed >= _REFRESH_NS:
            self._refreshed = pose.stamp
            yield from self._refresh(pose.stamp)
        if self._judged_at is None or pose.stamp - self._judged_at >= _JUDGE_NS:
            self._judged_at = pose.stamp
            yield from self._errors()

    def _pose(self, message: Message) -> Iterator[Draw]:
        pose = codec.decode_pose(message)
        bounds = self._bounds[1:] if self._bounds[0] == pose.stamp else (np.nan, np.nan)
        self._comparison.add(pose.stamp, pose.T_parent_child, *bounds)
        yield from self._map.pose(pose)

    def _path(self, message: Message) -> Iterator[Draw]:
        yield from self._map.path(message.stamp, codec.decode_path(message))

    def _loop(self, message: Message) -> Iterator[Draw]:
        loop = codec.decode_loop(message)
        if self._map.loop(loop):
            yield from self._words.loop(loop)

    def _status(self, message: Message) -> Iterator[Draw]:
        """Show a status at the newest image or pose: its own stamp is the wall time of its sending."""
        for status in codec.decode_status(message):
            stamp = self._newest
            if stamp is None:
                continue
            self._begin_segment(status.values.get("segment"), stamp)
            yield from self._words.status(stamp, status)
            for path, keys in (
                (entities.INLIERS, ("inliers", "matches")),
                (entities.TIMES, ("processing_ms", "latency_ms")),
            ):
                values = [_number(status.values.get(key)) for key in keys]
                if np.isfinite(values).any():
                    yield draw(path, stamp, rr.Scalars(values))

    def _begin_segment(self, segment: str | None, stamp: Stamp) -> None:
        """Forget how truth lies in the map when the odometry says that it has begun a map of its own again."""
        if segment is None or segment == self._segment[0]:
            return
        if self._segment[0] is not None:
            self._fit = None
        self._segment = segment, stamp if self._segment[0] is not None else Stamp(0)

    def _end(self, message: Message) -> Iterator[Draw]:
        if self._newest is None:
            return
        yield from self._refresh(self._newest)
        yield says(self._newest, INFO, f"The source has ended: {codec.decode_text(message) or 'complete'}")

    def _add_truth(self, body: str, message: Message) -> None:
        pose = codec.decode_pose(message)
        trail = self._trail(body)
        if trail is not None:
            trail.add(pose.stamp, pose.T_parent_child)
            if body == next(iter(self._truth)):
                self._comparison.add_truth(pose.stamp, pose.T_parent_child)

    def _trail(self, body: str) -> Trail | None:
        if body not in self._truth and len(self._truth) < _TRUTH_BODIES:
            self._truth[body] = Trail(4 * self._settings.path_poses)
        return self._truth.get(body)

    def _judged(self) -> Trail | None:
        """Return the truth that the estimate is compared with: that of the body heard of first."""
        return next(iter(self._truth.values()), None)

    def _refresh(self, stamp: Stamp) -> Iterator[Draw]:
        corrected = self._map.corrected()
        yield from self._map.refresh(stamp, corrected)
        truth = self._judged()
        if truth is not None and (fit := self._align(corrected, truth.trajectory())):
            yield from self._words.truth(stamp, fit, first=self._fit is None)
            self._fit = fit
        if self._fit is not None:
            for body, trail in self._truth.items():
                yield truth_line(body, stamp, in_map(trail.trajectory(), self._fit).positions, trail.strips())
        yield self._words.summary(stamp, self._fit, corrected.length_m)

    @property
    def _truth_is_the_cameras(self) -> bool:
        """Whether the body is called `camera`, which says that its truth is the camera's own; others carry markers."""
        return next(iter(self._truth), "") == _CAMERA_BODY

    def _align(self, corrected: Trajectory, truth: Trajectory) -> TruthInMap | None:
        corrected = corrected.take(corrected.stamps >= self._segment[1])
        calibrated = None if self._truth_is_the_cameras else self._calibration.update(corrected, truth)
        return align_truth(corrected, truth, calibrated)

    def _errors(self) -> Iterator[Draw]:
        """Judge the poses that truth has caught up with; those of a marker body wait until it is calibrated."""
        if self._fit is None or (self._fit.calibrated is None and not self._truth_is_the_cameras):
            return
        for error in self._comparison.errors(self._fit):
            self._words.error(error)
            millimetres = [1e3 * error.position_m, 1e3 * error.bound_m]
            yield draw(entities.POSITION_ERROR, error.stamp, rr.Scalars(millimetres))
            yield draw(entities.ROTATION_ERROR, error.stamp, rr.Scalars([error.rotation_deg, error.bound_deg]))


def _number(text: str | None) -> float:
    try:
        return float(text) if text is not None else np.nan
    except ValueError:
        return np.nan
