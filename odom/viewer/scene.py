"""Turns wire messages into updates of Rerun entities, without I/O and in bounded memory."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np
import rerun as rr

from odom.frame import Stamp
from odom.viewer import entities, palette
from odom.viewer.bounded_trajectory import RESTART_NS
from odom.viewer.camera_images import CameraImages
from odom.viewer.chain_scene import ChainScene
from odom.viewer.entities import EntityUpdate, update
from odom.viewer.event_log import INFO, EventLog, log_line
from odom.viewer.framing import Frame, Framing
from odom.viewer.keyframe_clouds import Cloud
from odom.viewer.map_scene import MapScene, trajectory
from odom.viewer.settings import ViewerSettings
from odom.viewer.truth_scene import TruthScene
from odom.wire import Message, Topics, codec, truth_body

_REFRESH_NS = 1_000_000_000
"""Between two drawings of the whole map: more often costs CPU; the newest pieces are drawn with every pose."""
_JUDGE_NS = 200_000_000
"""Between two comparisons with truth, of all poses since the one before."""

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

    What it yields belongs on `timeline`, another one from the first pose of a new run on: Rerun shows the end of a
    timeline, which lies in the run before where stamps go back.
    """

    def __init__(self, topics: Topics, settings: ViewerSettings) -> None:
        self._topics = topics
        self._settings = settings
        self._runs = 0
        self._begin()
        self._handlers: Mapping[str, Callable[[Message], Iterator[EntityUpdate]]] = {
            topics.camera_info: lambda message: self._images.camera_info(message),
            topics.color: self._color,
            topics.color_compressed: self._color,
            topics.depth: lambda message: self._images.depth(message),
            topics.depth_compressed: lambda message: self._images.depth(message),
            topics.features: lambda message: self._images.features(message),
            topics.moving: lambda message: self._images.moving(message),
            topics.landmarks: self._landmarks,
            topics.keyframes: self._keyframe,
            topics.odom: self._odometry,
            topics.pose: self._pose,
            topics.chain: lambda message: self._chain.pose(codec.decode_odometry(message)),
            topics.chain_closed: lambda message: self._chain.closed(message.stamp, codec.decode_path(message)),
            topics.path: self._path,
            topics.loops: self._loop,
            topics.status: self._status,
            topics.end: self._end,
        }

    def _begin(self) -> None:
        self._runs += 1
        self.timeline = entities.TIMELINE if self._runs == 1 else f"{entities.TIMELINE} {self._runs}"
        self._framing = Framing()
        self._frame: Frame | None = None
        self._images = CameraImages(self._settings.jpeg_quality)
        self._map = MapScene(self._settings)
        self._chain = ChainScene(self._settings)
        self._log = EventLog()
        self._truth = TruthScene(4 * self._settings.path_poses)
        self._segment: str | None = None
        self._newest: Stamp | None = None
        self._refreshed: Stamp | None = None
        self._judged_at: Stamp | None = None

    def setup(self) -> Iterator[EntityUpdate]:
        """Yield what never changes: axes and the styles of the plots."""
        yield update(entities.WORLD, None, rr.ViewCoordinates.RDF)
        for path, names, colors in _SERIES:
            yield update(path, None, rr.SeriesLines(names=names, colors=colors, widths=[1.8, 1.2]))

    def handle(self, message: Message) -> Iterator[EntityUpdate]:
        """Yield what a message changes."""
        topic = message.topic
        if handler := self._handlers.get(topic):
            yield from handler(message)
        elif topic.startswith(f"{self._topics.path}/"):
            yield from self._path(message)
        elif (body := truth_body(topic)) is not None:
            self._truth.add(body, codec.decode_pose(message))

    def history(self, message: Message) -> None:
        """Take a path of the time before this viewer started: `<ns>/history/...` or `truth/<body>/history`."""
        poses = codec.decode_path(message)
        if not poses:
            return
        if (body := truth_body(message.topic)) is not None:
            known = self._truth.trajectory_of(body)
        elif message.topic == self._topics.chain_history:
            known = self._chain.poses
        else:
            known = self._map.online
            self._newest = max(self._newest or poses[-1].stamp, poses[-1].stamp)
        if known is not None:
            known.prepend(trajectory(poses))

    def new_frame(self) -> Frame | None:
        """Return the new viewpoint of the map, None where it should stay; each frame is returned once."""
        frame, self._frame = self._frame, None
        return frame

    def everything(self) -> Iterator[EntityUpdate]:
        """Yield all that is static or slow once more, for browsers that open late."""
        if self._newest is not None:
            yield from self._map.all_points(self._newest)
            yield from self._refresh(self._newest)

    def trajectories(self) -> Iterator[EntityUpdate]:
        """Yield the whole trajectories and the summary as they are now, without a new calibration."""
        if self._newest is not None:
            yield from self._refresh(self._newest, calibrates=False)

    def _color(self, message: Message) -> Iterator[EntityUpdate]:
        if self._newest is None:
            self._newest = message.stamp
        yield from self._images.color(message)

    def _keyframe(self, message: Message) -> Iterator[EntityUpdate]:
        yield from self._map.cloud(message.stamp, Cloud(*codec.decode_cloud(message)))

    def _landmarks(self, message: Message) -> Iterator[EntityUpdate]:
        yield from self._map.landmarks(message.stamp, codec.decode_points(message))

    def _odometry(self, message: Message) -> Iterator[EntityUpdate]:
        pose = codec.decode_odometry(message)
        if self._newest is not None and pose.stamp < self._newest - RESTART_NS:
            self._begin()
            yield log_line(pose.stamp, INFO, "The time went back: a new run begins")
        self._newest = pose.stamp
        yield from self._map.odometry(pose)
        if self._refreshed is None or pose.stamp - self._refreshed >= _REFRESH_NS:
            self._refreshed = pose.stamp
            yield from self._refresh(pose.stamp)
        if self._judged_at is None or pose.stamp - self._judged_at >= _JUDGE_NS:
            self._judged_at = pose.stamp
            yield from self._errors()

    def _pose(self, message: Message) -> Iterator[EntityUpdate]:
        pose = codec.decode_pose(message)
        self._truth.compare(pose.stamp, pose.T_parent_child, self._map.claimed.get(pose.stamp))
        yield from self._map.pose(pose)

    def _path(self, message: Message) -> Iterator[EntityUpdate]:
        part = message.topic.removeprefix(self._topics.path).removeprefix("/")
        yield from self._map.path(message.stamp, codec.decode_path(message), part)

    def _loop(self, message: Message) -> Iterator[EntityUpdate]:
        loop = codec.decode_loop(message)
        if self._map.loop(loop):
            yield from self._log.loop(loop)

    def _status(self, message: Message) -> Iterator[EntityUpdate]:
        """Show a status at the newest image or pose: its own stamp is the wall time of its sending."""
        for status in codec.decode_status(message):
            stamp = self._newest
            if stamp is None:
                continue
            self._begin_segment(status.values.get("segment"), stamp)
            yield from self._log.status(stamp, status)
            for path, keys in (
                (entities.INLIERS, ("inliers", "matches")),
                (entities.TIMES, ("processing_ms", "latency_ms")),
            ):
                values = [_number(status.values.get(key)) for key in keys]
                if np.isfinite(values).any():
                    yield update(path, stamp, rr.Scalars(values))

    def _begin_segment(self, segment: str | None, stamp: Stamp) -> None:
        """Forget the alignment with truth when the odometry is in another segment."""
        if segment is None or segment == self._segment:
            return
        if self._segment is not None:
            self._truth.begin_segment(stamp)
        self._segment = segment

    def _end(self, message: Message) -> Iterator[EntityUpdate]:
        if self._newest is None:
            return
        yield from self._refresh(self._newest)
        yield log_line(self._newest, INFO, f"The source has ended: {codec.decode_text(message) or 'complete'}")

    def _refresh(self, stamp: Stamp, calibrates: bool = True) -> Iterator[EntityUpdate]:
        corrected = self._map.corrected()
        yield from self._map.refresh(stamp, corrected)
        yield from self._chain.refresh(stamp)
        if frame := self._framing.fit(self._images.median_depth_m, corrected.positions):
            self._frame = frame
            yield from self._images.resize(frame.frustum_m)
        was_aligned = self._truth.fit is not None
        if fit := self._truth.align(corrected, self._map.claimed, calibrates):
            yield from self._log.truth(stamp, fit, first=not was_aligned)
        yield from self._truth.lines(stamp)
        yield self._log.summary(stamp, self._truth.fit, bool(self._truth.trajectories), corrected)

    def _errors(self) -> Iterator[EntityUpdate]:
        for error in self._truth.errors():
            self._log.error(error)
            millimetres = [1e3 * error.position_m, 1e3 * error.bound_m]
            yield update(entities.POSITION_ERROR, error.stamp, rr.Scalars(millimetres))
            yield update(entities.ROTATION_ERROR, error.stamp, rr.Scalars([error.rotation_deg, error.bound_deg]))


def _number(text: str | None) -> float:
    try:
        return float(text) if text is not None else np.nan
    except ValueError:
        return np.nan
