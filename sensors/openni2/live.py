"""A live OpenNI2 device as a source: read in its own thread, survives being unplugged."""

import logging
import os
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain

from odom.errors import DeviceError, OdomError
from odom.frame import Camera, Stamp
from odom.wire import Message
from sensors.openni2 import advice, library
from sensors.openni2.device import OpenDevice, RawFrame
from sensors.openni2.device_clock import DeviceClock
from sensors.openni2.messages import Encoder
from sensors.openni2.presence import Departure, Listing, find
from sensors.openni2.settings import KinectSettings
from sensors.source import SourceOptions

_log = logging.getLogger(__name__)

WAITING = 24
"""Images held for the consumer before the oldest is dropped (0.4 s of colour and depth at 30 Hz)."""
LEARN_UNIT_NS = 200_000_000
LEARN_UNIT_FRAMES = 6
"""So long, and so many of a stream, the unit of the device's stamps is learnt from."""
RETRY_S = 0.1
MISSED_AFTER_S = 1.0
"""A stream that has been silent for so long is reported in the news of the device."""
REMIND_EVERY = 50
"""Every so many retries the log says again why the device cannot be opened."""


STREAMS = {True: "colour", False: "depth"}
"""Both streams by `RawFrame.is_color`."""


@dataclass(frozen=True, eq=False)
class _Received:
    frame: RawFrame
    host_ns: int
    connection: int


class LiveKinect:
    """Colour and depth of one device; what the consumer has no time for is dropped, the oldest first, and counted.

    `wanted` is an address or serial number, empty for the first device. Raises DeviceError when it cannot be opened;
    later failures are logged and mended: the device is opened again as soon as it is there. `counters` tells what was
    delivered, lost and dropped.
    """

    lossless = False
    length: int | None = None

    def __init__(self, wanted: str, options: SourceOptions, settings: KinectSettings) -> None:
        self._settings = settings
        self._seconds = options.seconds
        self._stop = threading.Event()
        self._ready = threading.Condition()
        self._waiting: deque[_Received] = deque()
        self._failure: BaseException | None = None
        self.counters = {"images": 0, "lost": 0, "dropped": 0, "reconnects": 0}
        self._departure: Departure | None = None
        self._heard = dict.fromkeys(STREAMS, time.monotonic())
        self._device: OpenDevice | None = self._open(wanted, library.devices())
        self.serial, self.name, self.uri = self._device.serial, self._device.name, self._device.uri
        try:
            factory = self._device.color_camera
            self._encoder = Encoder(options, settings, factory, self._device.registered)
        except OdomError:
            self.close()
            raise
        by = "by the driver" if self._device.registered else "not by the driver"
        _log.info("%s %s, serial %s, depth registered %s", self.name, self.uri, self.serial or "unknown", by)
        self._thread = threading.Thread(target=self._capture, name="openni2", daemon=True)
        self._thread.start()

    @property
    def camera(self) -> Camera:
        """Intrinsics of the colour image."""
        return self._encoder.camera

    def _open(self, wanted: str, listed: tuple[library.Listed, ...]) -> OpenDevice:
        uri = find(wanted, listed)
        if uri is None:
            raise advice.no_device(wanted, [str(device) for device in listed], advice.usb_cameras())
        device = OpenDevice(uri, self._settings)
        self._departure = Departure(uri)
        return device

    @property
    def _unplugged(self) -> bool:
        """Whether the driver has said so; not every driver does."""
        return self._departure is not None and self._departure.told.is_set()

    def _release(self) -> None:
        if self._device is not None:
            self._device.close()
        if self._departure is not None:
            self._departure.close()
        self._device = self._departure = None

    def _capture(self) -> None:
        """Read for as long as the source is open; runs in its own thread."""
        with suppress(PermissionError):  # the library keeps only the newest frame: whoever reads late loses one
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), -10)
        try:
            connection = 0
            while not self._stop.is_set():
                self._read_until_gone(connection)
                if self._stop.is_set():
                    break
                _log.error("%s %s is gone (unplugged or silent): waiting for it", self.name, self.uri)
                listing = Listing(self.uri, watched=self._unplugged)
                self._release()
                self._wait_for_device(listing)
                connection += 1
        except Exception as error:  # whatever it is, it ends this thread: the consumer raises it
            self._failure = error
        finally:
            self._release()
            with self._ready:
                self._ready.notify_all()

    def _read_until_gone(self, connection: int) -> None:
        device = self._device
        if device is None:
            return
        opened = time.monotonic()
        patience = dict.fromkeys(STREAMS, self._settings.start_s)
        last_index: dict[bool, int] = {}
        while not (self._stop.is_set() or self._unplugged):
            try:
                frame = device.read(0.05)
            except DeviceError as error:
                _log.error("%s", error)
                return
            host_ns, now = time.time_ns(), time.monotonic()
            if frame is not None:
                self._heard[frame.is_color] = now
                if frame.is_color in last_index:
                    self.counters["lost"] += max(0, frame.index - last_index[frame.is_color] - 1)
                    patience[frame.is_color] = self._settings.silence_s
                last_index[frame.is_color] = frame.index
                self._put(_Received(frame, host_ns, connection))
            quiet_s = {which: now - max(opened, self._heard[which]) for which in STREAMS}
            if any(quiet_s[which] >= patience[which] for which in STREAMS):
                # the last images of both never come at once: half the time tells whether the other is silent too
                silent = [which for which in STREAMS if 2 * quiet_s[which] >= patience[which]]
                self._miss(silent, patience[silent[0]], never=connection == 0 and not last_index.keys() & set(silent))
                return

    def _miss(self, silent: list[bool], patience: float, never: bool) -> None:
        """Say which stream is missing while the other comes; raises DeviceError when it has `never` come."""
        error = advice.no_frames(self.uri, "image" if len(silent) > 1 else STREAMS[silent[0]], patience)
        if never:
            raise error
        if len(silent) == 1:
            _log.error("%s", error)

    def _put(self, received: _Received) -> None:
        with self._ready:
            if len(self._waiting) >= WAITING:
                self._waiting.popleft()
                self.counters["dropped"] += 1
            self._waiting.append(received)
            self.counters["images"] += 1
            self._ready.notify()

    def _wait_for_device(self, listing: Listing) -> None:
        attempt = 0
        while not self._stop.wait(RETRY_S):
            attempt += 1
            try:
                listed = listing.look()
                if not listed:
                    continue
                # The address of a USB device changes with every plugging in; without serial number any device is taken.
                self._device = self._open(self.serial, listed)
            except DeviceError as error:
                if attempt % REMIND_EVERY == 1:
                    _log.warning("%s", error)
                self._release()
                continue
            self.uri = self._device.uri
            self.counters["reconnects"] += 1
            _log.warning("%s %s is back after %.1f s", self.name, self.uri, attempt * RETRY_S)
            return

    def messages(self) -> Iterator[Message]:
        """Yield calibration, colour and depth as they arrive; raises DeviceError when the device never delivers."""
        clock = DeviceClock()
        connection = 0
        begun: float | None = None
        told_ns = 0
        arriving = self._received()
        first = next(arriving, None)
        if first is None:
            return
        yield self._encoder.info(Stamp(first.host_ns))  # while the clock is learnt whoever listens can get ready
        for received in self._learned(clock, chain([first], arriving)):
            if received.connection != connection:
                connection = received.connection
                clock.restart()
            stamp = clock.stamp(received.frame.is_color, received.frame.ticks, received.host_ns)
            if stamp is None:
                with self._ready:
                    self.counters["dropped"] += 1
                continue
            begun = time.monotonic() if begun is None else begun  # the clock of the stamps may be set meanwhile
            if self._seconds is not None and time.monotonic() - begun >= self._seconds:
                return
            if abs(stamp - told_ns) >= 1_000_000_000:
                told_ns = stamp
                yield self._encoder.device(stamp, self.name, self._missing(), self._particulars(clock))
            yield self._encoder.image(received.frame, stamp)

    def _missing(self) -> list[str]:
        """Return the names of the streams that are silent."""
        now = time.monotonic()
        return [name for which, name in STREAMS.items() if now - self._heard[which] > MISSED_AFTER_S]

    def _particulars(self, clock: DeviceClock) -> dict[str, str]:
        counts = {name: str(count) for name, count in self.counters.items()}
        return {"uri": self.uri, "serial": self.serial, "drift_ppm": f"{clock.mapping.drift_ppm:.1f}", **counts}

    def _learned(self, clock: DeviceClock, arriving: Iterator[_Received]) -> Iterator[_Received]:
        """Yield what is received once the unit of the stamps is known.

        The images before serve to learn it and, like those that have waited for somebody to read them, are not passed
        on: all at once they would only crowd out each other at whoever listens.
        """
        held: list[_Received] = []
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
                with self._ready:
                    self._waiting.clear()

    def _received(self) -> Iterator[_Received]:
        while True:
            with self._ready:
                while not self._waiting:
                    if self._failure is not None:
                        raise self._failure
                    if self._stop.is_set():
                        return
                    self._ready.wait(0.2)
                received = self._waiting.popleft()
            yield received

    def close(self) -> None:
        """Stop reading and give the device back."""
        self._stop.set()
        with self._ready:
            self._ready.notify_all()
        thread = getattr(self, "_thread", None)
        if thread is None:
            self._release()
        elif thread is not threading.current_thread():
            thread.join(timeout=5)
            counts = ", ".join(f"{count} {name}" for name, count in self.counters.items())
            _log.info("%s %s: %s", self.name, self.uri, counts)
            del self._thread
