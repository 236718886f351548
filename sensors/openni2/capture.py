"""Reads one device in a thread of its own, and opens it again when it comes back after being unplugged."""

import logging
import os
import queue
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass

from odom.errors import DeviceError
from sensors.openni2 import advice, library
from sensors.openni2.device import OpenDevice, RawFrame
from sensors.openni2.presence import Departure, Listing, find
from sensors.openni2.settings import KinectSettings

_log = logging.getLogger(__name__)

WAITING = 24
"""Images held for the consumer before the oldest is dropped: 0.4 s of colour and depth at 30 Hz; more adds delay."""
READ_S = 0.05
"""Seconds to wait for a frame before looking whether to stop; longer makes closing slower."""
RETRY_S = 0.1
"""Seconds between two looks for a lost device: shorter finds it sooner and asks the driver more often."""
MISSED_AFTER_S = 1.0
"""Seconds of silence after which a stream is reported as missing: 30 images."""
REMIND_EVERY = 50
"""Every so many retries (5 s) the log says again why the device cannot be opened."""
_NICE = -10
"""Priority of the reading thread, where permitted: the library keeps only the newest frame, a late reader loses one."""

STREAMS = {True: "colour", False: "depth"}
"""Both streams by `RawFrame.is_color`."""


@dataclass(frozen=True, eq=False)
class Received:
    """A frame, when it came (ns of this machine's clock), and how often the device had been opened again by then."""

    frame: RawFrame
    host_ns: int
    connection: int


class DeviceCapture:
    """Holds the newest frames of one device for one consumer; the oldest are dropped and counted when they are many.

    `wanted` is an address or serial number, empty for the first device. Raises DeviceError when it cannot be opened;
    later failures are logged, and the device is opened again as soon as it is back. `start` begins to read.
    """

    def __init__(self, wanted: str, settings: KinectSettings) -> None:
        self._settings = settings
        self._stop = threading.Event()
        self._waiting: queue.SimpleQueue[Received | None] = queue.SimpleQueue()
        self._failure: BaseException | None = None
        self.counters = {"images": 0, "lost": 0, "dropped": 0, "reconnects": 0}
        self._is_taken = False
        self.end_s: float | None = None
        self._departure: Departure | None = None
        self._heard = dict.fromkeys(STREAMS, time.monotonic())
        self._device: OpenDevice | None = None
        self._others = set[str]()
        self.opened = self._open(wanted, library.devices())
        self.serial, self.name, self.uri = self.opened.serial, self.opened.name, self.opened.uri
        self._thread = threading.Thread(target=self._capture, name="openni2", daemon=True)

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def _open(self, wanted: str, listed: tuple[library.Listed, ...]) -> OpenDevice:
        uri = find(wanted, listed)
        if uri is None:
            raise advice.no_device(wanted, [str(device) for device in listed], advice.usb_cameras())
        self._device = OpenDevice(uri, self._settings)
        self._others |= {device.uri for device in listed} - {uri}
        self._departure = Departure(uri)
        return self._device

    @property
    def _unplugged(self) -> bool:
        """Whether the driver has said so; not every driver does."""
        return self._departure is not None and self._departure.reported.is_set()

    def _release(self) -> None:
        for held in (self._device, self._departure):
            if held is not None:
                held.close()
        self._device = self._departure = None

    def _capture(self) -> None:
        """Read until `close`; runs in its own thread."""
        with suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
        try:
            connection = 0
            while self._device is not None:
                self._read_until_gone(self._device, connection)
                if self._stop.is_set():
                    break
                _log.error("%s %s is gone (unplugged or silent): waiting for it", self.name, self.uri)
                listing = Listing(self.uri, watched=self._unplugged)
                self._release()
                self._wait_for_device(listing)
                connection += 1
        except Exception as error:  # of any kind: it ends this thread, and the consumer raises it
            self._failure = error
        finally:
            self._release()
            self._waiting.put(None)

    def _read_until_gone(self, device: OpenDevice, connection: int) -> None:
        opened = time.monotonic()
        patience = dict.fromkeys(STREAMS, self._settings.start_s)
        last_index: dict[bool, int] = {}
        while not (self._stop.is_set() or self._unplugged):
            try:
                frame = device.read(READ_S)
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
                self._put(Received(frame, host_ns, connection))
            quiet_s = {which: now - max(opened, self._heard[which]) for which in STREAMS}
            if any(quiet_s[which] >= patience[which] for which in STREAMS):
                # the last images of both never come at once: half the time shows whether the other is silent too
                silent = [which for which in STREAMS if 2 * quiet_s[which] >= patience[which]]
                never = connection == 0 and not last_index.keys() & set(silent)
                self._miss(silent, patience[silent[0]], never)
                return

    def _miss(self, silent: list[bool], patience: float, never: bool) -> None:
        """Say which stream is missing while the other comes; raises DeviceError when it has `never` come."""
        error = advice.no_frames(self.uri, "image" if len(silent) > 1 else STREAMS[silent[0]], patience)
        if never:
            raise error
        if len(silent) == 1:
            _log.error("%s", error)

    def _put(self, received: Received) -> None:
        while self._waiting.qsize() >= WAITING:
            with suppress(queue.Empty):  # the consumer may have been quicker
                self._waiting.get_nowait()
                self.counters["dropped"] += self._is_taken
        self._waiting.put(received)
        self.counters["images"] += 1

    def _wait_for_device(self, listing: Listing) -> None:
        attempt = 0
        while not self._stop.wait(RETRY_S):
            attempt += 1
            try:
                listed = listing.look()
                self._others &= {device.uri for device in listed}
                if not self.serial:
                    # The address of a USB device changes with every plugging in: any that was not there beside it.
                    listed = tuple(device for device in listed if device.uri not in self._others)
                if not listed:
                    continue
                self.uri = self._open(self.serial, listed).uri
            except DeviceError as error:
                if attempt % REMIND_EVERY == 1:
                    _log.warning("%s", error)
                self._release()
                continue
            self.counters["reconnects"] += 1
            _log.warning("%s %s is back after %.1f s", self.name, self.uri, attempt * RETRY_S)
            return

    def missing(self) -> list[str]:
        """Return the names of the streams that are silent."""
        now = time.monotonic()
        return [name for which, name in STREAMS.items() if now - self._heard[which] > MISSED_AFTER_S]

    def forget_waiting(self) -> None:
        """Drop, without counting them, the images that wait."""
        with suppress(queue.Empty):
            while (item := self._waiting.get_nowait()) is not None:
                pass
            self._waiting.put(item)

    def _left_s(self) -> float | None:
        if self.end_s is None:
            return None
        left_s = self.end_s - time.monotonic()
        if left_s <= 0:
            raise queue.Empty
        return left_s

    def received(self) -> Iterator[Received]:
        """Yield the frames as they come, until `close` or `end_s` (time.monotonic), if set meanwhile.

        Raises what ended the reading.
        """
        self._is_taken, self.end_s = True, None
        try:
            while (item := self._waiting.get(timeout=self._left_s())) is not None:
                yield item
        except queue.Empty:
            return
        self._waiting.put(None)  # so that a second call ends too
        if self._failure is not None:
            raise self._failure

    def close(self) -> None:
        """Stop reading and give the device back; safe to call twice."""
        already = self._stop.is_set()
        self._stop.set()
        if self._thread.ident is None:
            self._release()
            self._waiting.put(None)
        elif not already and self._thread is not threading.current_thread():
            self._thread.join(timeout=5)
