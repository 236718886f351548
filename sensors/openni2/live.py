"""A live OpenNI2 device as a source: its frames with stamps of this machine's clock, and news of the device."""

import logging
import time
from collections.abc import Iterator
from itertools import chain

from odom.errors import OdomError
from odom.frame import Stamp
from odom.wire import Message
from sensors.openni2.capture import DeviceCapture, Received
from sensors.openni2.device_clock import DeviceClock
from sensors.openni2.messages import DeviceEncoder
from sensors.openni2.settings import KinectSettings
from sensors.source import SourceOptions

_log = logging.getLogger(__name__)

LEARN_UNIT_NS, LEARN_UNIT_FRAMES = 200_000_000, 6
"""The unit of the device's stamps is learnt from at least this time (ns) and this number of frames of a stream.

Fewer may name a wrong unit on a loaded machine; more delays the first image.
"""
NEWS_EVERY_NS = 1_000_000_000
"""Nanoseconds between two messages about the device."""


class LiveKinect:
    """Colour and depth of one device; what the consumer is too slow for is dropped, the oldest first, and counted.

    `wanted` is an address or serial number, empty for the first device. Raises DeviceError when it cannot be opened;
    later failures are logged, and its `capture` opens the device again.
    """

    lossless = False
    length: int | None = None

    def __init__(self, wanted: str, options: SourceOptions, settings: KinectSettings) -> None:
        self._settings = settings
        self._seconds = options.seconds
        self.capture = DeviceCapture(wanted, settings)
        self._unstamped = 0
        self._closed = False
        device = self.capture.opened
        try:
            self._encoder = DeviceEncoder(options, settings, device.color_camera, device.registered, device.serial)
        except OdomError:
            self.capture.close()
            raise
        by = "by the driver" if device.registered else "not by the driver"
        _log.info("%s %s, serial %s, depth registered %s", device.name, device.uri, device.serial or "unknown", by)
        self.capture.start()

    @property
    def serial(self) -> str:
        """The device's serial number, empty where its driver does not say it."""
        return self.capture.serial

    @property
    def counters(self) -> dict[str, int]:
        """Images delivered, lost and dropped, and how often the device was opened again."""
        counts = self.capture.counters
        return {**counts, "dropped": counts["dropped"] + self._unstamped}

    def messages(self) -> Iterator[Message]:
        """Yield calibration, colour and depth as they arrive; raises DeviceError when the device never delivers."""
        clock = DeviceClock()
        connection = 0
        news_ns = 0
        arriving = self.capture.received()
        first = next(arriving, None)
        if first is None:
            return
        yield from self._encoder.info(Stamp(first.host_ns))  # consumers can get ready while the clock is learnt
        for received in self._learned(clock, chain([first], arriving)):
            if received.connection != connection:
                connection = received.connection
                clock.restart()
            stamp = clock.stamp(received.frame.is_color, received.frame.ticks, received.host_ns)
            if stamp is None:
                self._unstamped += 1
                continue
            if self._seconds is not None and self.capture.end_s is None:
                self.capture.end_s = time.monotonic() + self._seconds  # the clock of the stamps may be set meanwhile
            if abs(stamp - news_ns) >= NEWS_EVERY_NS:
                news_ns = stamp
                yield self._news(stamp, clock)
            yield self._encoder.image(received.frame, stamp)

    def _news(self, stamp: Stamp, clock: DeviceClock) -> Message:
        capture = self.capture
        values = {"uri": capture.uri, "serial": capture.serial, "drift_ppm": f"{clock.mapping.drift_ppm:.1f}"}
        counts = {name: str(count) for name, count in self.counters.items()}
        return self._encoder.device(stamp, capture.name, capture.missing(), values | counts)

    def _learned(self, clock: DeviceClock, arriving: Iterator[Received]) -> Iterator[Received]:
        """Yield what is received once the unit of the stamps is known.

        The images before that serve to learn it; they and those that wait by then are not passed on, since a consumer
        that gets them all at once would drop most of them.
        """
        held: list[Received] = []
        for received in arriving:
            if clock.knows_unit:
                yield received
                continue
            held.append(received)
            same = [r for r in held if r.frame.is_color == received.frame.is_color]
            if received.host_ns - same[0].host_ns >= LEARN_UNIT_NS and len(same) >= LEARN_UNIT_FRAMES:
                clock.learn_unit([(r.frame.ticks, r.host_ns) for r in same], 1e9 / self._settings.fps)
                for r in held:
                    clock.stamp(r.frame.is_color, r.frame.ticks, r.host_ns)
                self.capture.forget_waiting()

    def close(self) -> None:
        """Stop reading and give the device back."""
        self.capture.close()
        if not self._closed:
            self._closed = True
            counts = ", ".join(f"{count} {name}" for name, count in self.counters.items())
            _log.info("%s %s: %s", self.capture.name, self.capture.uri, counts)
