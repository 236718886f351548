"""Finds a device by address or serial number, notices that it is unplugged, and finds it again."""

import logging
import threading
from typing import Any

from sensors.openni2 import library
from sensors.openni2.device import serial_number

_log = logging.getLogger(__name__)

RESTART_EVERY = 5
"""Looks between two restarts of the library, for drivers that list devices only then: more find them later."""


def find(wanted: str, listed: tuple[library.Listed, ...]) -> str | None:
    """Return the address of the device whose address or serial number is `wanted` (empty: the first); None for none."""
    if not listed:
        return None
    if not wanted:
        return listed[0].uri
    for device in listed:
        if device.uri == wanted:
            return device.uri
    api = library.load()
    for device in listed:
        try:
            opened = library.open_device(device.uri)
        except api.OpenNIError as error:
            _log.debug("%s is passed over: %s", device, library.said(error))
            continue
        try:
            if serial_number(api, opened) == wanted:
                return device.uri
        finally:
            opened.close()
    return None


class Departure:
    """Sets `reported` when OpenNI2 reports that `uri` was unplugged, until closed."""

    def __init__(self, uri: str) -> None:
        self.reported = threading.Event()
        self._listener: Any = library.load().DeviceListener()

        def disconnected(info: Any) -> None:
            if info.uri == uri.encode():
                self.reported.set()

        self._listener.on_disconnected = disconnected

    def close(self) -> None:
        """Listen no longer."""
        self._listener.close()


class Listing:
    """The library's list of devices while a lost one is waited for; `watched` says that its driver reported the loss.

    A driver that watches the bus takes a lost device off the list and puts it back by itself. Others (libfreenect's)
    list devices only when they are initialised: for them, and only for them, the library is restarted now and then. A
    restart can block for ever: the library holds its lock while it waits for the driver's threads, and one of these
    waits for the lock when it reports a device that has just been plugged in.
    """

    def __init__(self, uri: str, watched: bool) -> None:
        self._watched = watched
        self._known = {uri}
        self._looks = 0

    def look(self) -> tuple[library.Listed, ...]:
        """Return what is listed now. No handle of the library may be open."""
        self._looks += 1
        if self._looks % RESTART_EVERY == 0 and not self._watched:
            library.restart()
            self._known = set()
        listed = library.devices()
        known, self._known = self._known, {device.uri for device in listed}
        self._watched |= bool(known - self._known)
        return listed
