"""Receives messages and decodes frames in a thread of its own, beside the odometry.

Frame i + 1 is decoded while frame i is processed: Zenoh and OpenCV release the interpreter's lock.
"""

import logging
import threading
from collections import Counter
from contextlib import suppress
from dataclasses import replace

from odom.errors import ConfigError, WireError
from odom.frame import Camera, RgbdFrame, Stamp
from odom.frontend.features.image_scale import scaled_lens
from odom.service.arrival_queue import (
    MOST_TRUTH,
    ArrivalQueue,
    CameraArrival,
    ColorArrival,
    EndArrival,
    FrameArrival,
    TruthArrival,
)
from odom.wire import TRUTH, Message, Topics, codec, truth_body
from odom.wire.assembler import FrameAssembler
from odom.wire.consumer import Consumer
from odom.wire.image_counts import LOST, NOT_CALIBRATED, OTHER_SIZE, OVERTAKEN, UNREADABLE, ImageCounts
from odom.wire.session import Delivery, WireSession

_LOG = logging.getLogger(__name__)
_LIVE_DEPTH = 3
"""Messages of a live key that wait to be decoded: more add 33 ms of latency each, fewer are lost to short delays."""
_POLL_S = 0.2
"""Longest wait for a message; `close` is noticed at most this late."""
_COLORS = 32
"""Colour messages kept until their depth comes, one second: with fewer, key frames lose their coloured clouds."""
_MOST_BODIES = 16
"""Motion capture bodies, each with an open file of its own; a rig has one to three."""
_LIVE_CLOCK_NS = 10_000_000_000
"""A capture stamp nearer than this to the time of sending is by the host's clock: latency counts from the capture.
Recordings are days old, clocks of hosts are off by less."""


class FrameReceiver:
    """Receives, pairs and decodes from `start` to `close`; results are taken from `arrivals`.

    `conflict` says that the sensor's calibration is another than the one in use, empty where it is not.
    """

    def __init__(self, session: WireSession, topics: Topics, live_room: int) -> None:
        self.uncalibrated = 0
        self.conflict = ""
        self._has_ended = False
        self.refused_cameras = 0
        self._color_keys, self._depth_keys = topics.color_keys, topics.depth_keys
        self._colors: dict[Stamp, Message] = {}
        self._bodies: set[str] = set()
        self._info_keys = topics.camera_info, topics.depth_info
        keys = (*topics.color_keys, *topics.depth_keys, *self._info_keys, TRUTH)
        self._consumer = Consumer(session, topics, "odometry", keys, depth=_LIVE_DEPTH)
        self.assembler = FrameAssembler(topics, grey=True, malformed=self._consumer.malformed)
        self._until_end = False
        self._camera_in_use: Camera | None = None
        self._refused_by_odometry: Camera | None = None
        self.arrivals = ArrivalQueue(live_room)
        self._thread = threading.Thread(target=self._run, name="intake", daemon=True)

    @property
    def source_ended(self) -> bool:
        """Whether the end of the source has come, and none of its messages since, though motion capture may go on.

        Known before the sensor learns that its end has come.
        """
        return self._has_ended or self._consumer.ended is not None

    def start(self, until_end: bool = False) -> None:
        """Begin to receive, with `until_end` no longer than to the end of the source: `close` need not wait then."""
        self._until_end = until_end
        self._thread.start()

    def close(self) -> None:
        """Stop receiving; the arrivals that wait can still be taken."""
        self.arrivals.close()
        self._thread.join(timeout=2.0)

    def refuse(self, camera: Camera) -> None:
        """Note that the odometry refused this calibration: the next one that differs is handed on."""
        self._refused_by_odometry = camera

    @property
    def lost_frames(self) -> int:
        """Colour images that were sent but lost on the way, or dropped for newer ones."""
        return self.arrivals.overtaken + self._lost(self._color_keys)

    @property
    def unmatched_frames(self) -> int:
        """Frames whose colour image had no depth image beside it."""
        return self.assembler.pairing.color_single

    @property
    def color(self) -> ImageCounts:
        """What became of the colour images; those that wait for the odometry count as used."""
        counts = self.assembler.pairing.color.plus({LOST: self._lost(self._color_keys)})
        late = {OVERTAKEN: self.arrivals.overtaken, NOT_CALIBRATED: self.uncalibrated}
        return replace(counts, used=counts.used - sum(late.values()), refused=counts.refused + Counter(late))

    @property
    def depth(self) -> ImageCounts:
        """What became of the depth images."""
        return self.assembler.pairing.depth.plus({LOST: self._lost(self._depth_keys)})

    @property
    def dropped(self) -> dict[str, int]:
        """Count of refused input by its kind, without zeros."""
        counts = {f"malformed {key}": n for key, n in self._consumer.malformed.counts.copy().items()}
        for stream, images in (("colour", self.color), ("depth", self.depth)):
            counts |= {
                f"{stream}: {why}": n for why, n in images.refused.items() if why not in (UNREADABLE, OTHER_SIZE)
            }
        counts["refused calibration"] = self.refused_cameras
        return {kind: n for kind, n in sorted(counts.items()) if n}

    def _lost(self, keys: tuple[str, ...]) -> int:
        counters = [self._consumer.counters.get(key) for key in keys]
        return sum(c.lost + c.dropped for c in counters if c is not None)

    def _run(self) -> None:
        try:
            self._receive()
        except BaseException as error:  # `take` raises it in the other thread
            self.arrivals.fail(error)

    def _receive(self) -> None:
        while not self.arrivals.is_closed:
            delivery = self._consumer.receive(timeout=_POLL_S)
            if delivery is not None:
                self._take_message(delivery)
            elif self._consumer.ended is not None:
                self._has_ended = True
                for frame in self.assembler.finish():
                    self._put_frame(frame, None)
                self.arrivals.put(EndArrival(self._consumer.ended))
                if self._until_end:
                    return
                self._consumer.restart()
        for frame in self.assembler.finish():  # what waits for a nearer partner when the run is stopped
            self._put_frame(frame, None)

    def _take_message(self, delivery: Delivery) -> None:
        message = delivery.message
        if message.topic.startswith("truth/"):
            self._take_truth(message)
            return
        self._has_ended = False
        if message.topic in self._color_keys:
            self._colors[message.stamp] = message
            if len(self._colors) > _COLORS:
                del self._colors[next(iter(self._colors))]
        if message.topic in self._info_keys:
            self.conflict = ""
        for frame in self.assembler.feed(message):
            self._put_frame(frame, delivery)
        if message.topic in self._color_keys and not delivery.lossless:
            self._put_color()
        self._keep_camera_in_use()
        if self._camera_in_use is None and self.assembler.camera is not None:
            _compute_lens(self.assembler.camera)

    def _take_truth(self, message: Message) -> None:
        """Hand on a true pose, of at most 16 bodies; a body's name must be fit for a file's name."""
        malformed, body = self._consumer.malformed, truth_body(message.topic)
        if body is None:
            malformed.add(TRUTH, f"{message.topic!r}: a body's name is 1 to 64 letters, digits and underscores")
            return
        if body not in self._bodies and len(self._bodies) >= _MOST_BODIES:
            malformed.add(TRUTH, f"{message.topic}: more than {_MOST_BODIES} bodies")
            return
        try:
            arrival = TruthArrival(body, codec.decode_pose(message))
        except WireError as error:
            malformed.add(message.topic, str(error))
            return
        self._bodies.add(body)
        if not self.arrivals.put(arrival):
            malformed.add(TRUTH, f"more than {MOST_TRUTH} poses wait")

    def _keep_camera_in_use(self) -> None:
        """Keep the calibration in use: with another one new poses would silently not fit the earlier ones."""
        camera = self.assembler.camera
        if self._camera_in_use == self._refused_by_odometry:
            self._camera_in_use = None
        is_another = self._camera_in_use is not None and camera != self._camera_in_use
        if camera is None or not (is_another or camera == self._refused_by_odometry):
            return
        if is_another:
            self.conflict = f"the calibration has changed to {camera}: refused; restart to use it"
            if not self.refused_cameras:
                _LOG.error(self.conflict)
        self.refused_cameras += 1
        self.assembler.camera = self._camera_in_use

    def _has_camera(self) -> bool:
        """Hand on the calibration before the first frame; return whether there is one."""
        if self._camera_in_use is None and self.assembler.camera is not None:
            self._camera_in_use = self.assembler.camera
            _LOG.info("calibration: %s", self._camera_in_use)
            self.arrivals.put(CameraArrival(self._camera_in_use))
        return self._camera_in_use is not None

    def _color_of(self, frame: RgbdFrame) -> Message | None:
        """Return the message of a frame's colour image; forget it and older ones, whose depth never came."""
        for stamp in list(self._colors):
            message = self._colors.pop(stamp)
            if stamp == frame.stamp:
                return message
        return None

    def _put_frame(self, frame: RgbdFrame, delivery: Delivery | None) -> None:
        color = self._color_of(frame)
        if not self._has_camera():
            self.uncalibrated += 1
            return
        live = delivery is not None and not delivery.lossless
        origin = _origin(frame, delivery) if live else None
        self.arrivals.put_frame(FrameArrival(frame, origin, color), live)

    def _put_color(self) -> None:
        waiting = self.assembler.newest_color
        if waiting is not None and self._camera_in_use is not None:
            self.arrivals.put_color(ColorArrival(*waiting))


def _compute_lens(camera: Camera) -> None:
    """Compute the table of a lens before the first frame, which would wait for it."""
    with suppress(ConfigError):  # the odometry says what is wrong
        scaled_lens(camera)


def _origin(frame: RgbdFrame, delivery: Delivery | None) -> Stamp:
    sent = delivery.sent if delivery is not None else None
    if sent is None or abs(sent - frame.stamp) < _LIVE_CLOCK_NS:
        return frame.stamp
    return sent
