"""Stamps a device's images in the host's time."""

import logging

import numpy as np

from odom.frame import Stamp
from odom.wire.pairing import LEAP_NS
from sensors.host_time import ClockMapping, Unwrap, tick_length

_log = logging.getLogger(__name__)

_LEAST_INTERVAL = 0.1
"""Share of the nominal period: images stamped closer to the one before show no motion and confuse the pairing."""


class DeviceClock:
    """Stamps of one device in the host's time, in whatever unit the device counts; those of each stream increase.

    When the estimate of the device's clock improves, or the host's clock is set back by up to a second, images get no
    stamp until time has passed the last stamp. When it is set back further, the stamps follow it.
    """

    def __init__(self) -> None:
        self._unit_ns: float | None = None
        self._period_ns = 0.0
        self._last: dict[bool, int] = {}
        self.restart()

    def restart(self) -> None:
        """Forget the relation of the clocks: the device's starts anew when it is plugged in. Its unit stays."""
        self.mapping = ClockMapping()
        self._unwrap = Unwrap(32)

    @property
    def knows_unit(self) -> bool:
        """Whether the unit of the device's stamps is known."""
        return self._unit_ns is not None

    def learn_unit(self, frames: list[tuple[int, int]], period_ns: float) -> None:
        """Settle the unit from the stamp (ticks) and receipt (ns) of one stream's frames, nominally `period_ns` apart.

        The nominal rate decides, since a loaded machine's times of receipt may be off by tens of milliseconds; where it
        does not fit (a camera that halves its rate in the dark) the times of receipt decide.
        """
        ticks = np.diff([stamp for stamp, _ in frames]) % (1 << 32)
        elapsed_ns = frames[-1][1] - frames[0][1]
        unit = tick_length(int(np.median(ticks)), round(period_ns)) or tick_length(int(ticks.sum()), elapsed_ns)
        self._unit_ns = unit or 0.0
        self._period_ns = period_ns
        if unit is None:
            _log.warning("the device's time stamps run at no known rate: the time of receipt is used instead")

    def stamp(self, is_color: bool, ticks: int, host_ns: int) -> Stamp | None:
        """Return the capture time of an image stamped `ticks` and received at `host_ns`, None for one to drop.

        `learn_unit` must have been called before.
        """
        stamp = host_ns
        if self._unit_ns:
            device_ns = round(self._unwrap(ticks) * self._unit_ns)
            self.mapping.observe(device_ns, host_ns)
            stamp = self.mapping.to_host(device_ns)
        last = self._last.get(is_color)
        if last is not None and -LEAP_NS <= stamp - last < _LEAST_INTERVAL * self._period_ns:
            return None
        self._last[is_color] = stamp
        return Stamp(stamp)
