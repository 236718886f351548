"""Which depth image belongs to which colour image.

Colour and depth are taken at instants of their own. Each depth image is paired with the nearest colour image within
half a period, one to one; the outcome depends on the stamps and the order within each stream, not on when a message
arrives, as long as neither stream is more than `capacity` images ahead of the other.

Policy for bad stamps, each counted: one equal to the stream's last is a duplicate and dropped; one before it, by up to
a second, goes backward and is dropped; one more than a second away in either direction is a leap, held until the
next image of its stream confirms it (then both are taken, and after a leap back the images that wait in either stream
are single), or disowns it (then it is dropped as a stray).
"""

from collections import deque
from dataclasses import dataclass
from statistics import median
from typing import Generic, TypeVar

from odom.frame import Stamp

C = TypeVar("C")
D = TypeVar("D")
T = TypeVar("T")

LEAP_NS = 1_000_000_000
_DEFAULT_PERIOD_NS = 1_000_000_000 / 30
_PERIODS = 15
_SHORTEST_INTERVAL = 0.9


@dataclass(frozen=True, eq=False)
class Pair(Generic[C, D]):
    """A colour and a depth image that belong together; `leap` on the first pair behind a leap of the stamps."""

    color_stamp: Stamp
    color: C
    depth_stamp: Stamp
    depth: D
    leap: bool = False


@dataclass
class PairingCounters:
    """What became of the images that are not in a pair, and how often the stamps leapt."""

    pairs: int = 0
    color_single: int = 0
    depth_single: int = 0
    duplicate: int = 0
    backward: int = 0
    stray: int = 0
    leaps: int = 0

    @property
    def unmatched(self) -> int:
        """Images with a good stamp that found no partner."""
        return self.color_single + self.depth_single


class _Stream(Generic[T]):
    """One stream of images behind the policy for bad stamps."""

    def __init__(self, counters: PairingCounters) -> None:
        self.waiting: deque[tuple[Stamp, T]] = deque()
        self.leapt = False
        self.went_back = False
        self._counters = counters
        self._last: Stamp | None = None
        self._held: tuple[Stamp, T] | None = None

    def feed(self, stamp: Stamp, item: T) -> list[Stamp]:
        """Take an image; return the stamps that were accepted by that."""
        if self._held is not None:
            held, self._held = self._held, None
            if 0 < stamp - held[0] <= LEAP_NS:
                self.went_back = self._last is not None and held[0] < self._last
                self.leapt = True
                self._counters.leaps += 1
                return [*self._accept(*held), *self._accept(stamp, item)]
            self._counters.stray += 1
        if self._last is not None:
            step = stamp - self._last
            if step == 0:
                self._counters.duplicate += 1
                return []
            if -LEAP_NS <= step < 0:
                self._counters.backward += 1
                return []
            if abs(step) > LEAP_NS:
                self._held = (stamp, item)
                return []
        return self._accept(stamp, item)

    def _accept(self, stamp: Stamp, item: T) -> list[Stamp]:
        self._last = stamp
        self.waiting.append((stamp, item))
        return [stamp]


class Pairer(Generic[C, D]):
    """Pairs two streams; pure: its answer depends on what it was fed only.

    `period_s` is the colour period; None measures it (median of the last intervals, 1/30 s at the beginning).
    """

    def __init__(self, period_s: float | None = None, capacity: int = 32) -> None:
        self.counters = PairingCounters()
        self._fixed_period = None if period_s is None else period_s * 1e9
        self._capacity = capacity
        self._intervals: deque[int] = deque(maxlen=_PERIODS)
        self._last_color: Stamp | None = None
        self._color: _Stream[tuple[float, C]] = _Stream(self.counters)
        self._depth: _Stream[D] = _Stream(self.counters)

    def add_color(self, stamp: Stamp, color: C) -> list[Pair[C, D]]:
        """Take the next colour image and return the pairs that are certain now, in the order of their stamps."""
        accepted = self._color.feed(stamp, (0.0, color))
        first = len(self._color.waiting) - len(accepted)
        for i, at in enumerate(accepted, start=first):
            if self._last_color is not None and 0 < at - self._last_color <= LEAP_NS:
                self._intervals.append(at - self._last_color)
            self._last_color = at
            self._color.waiting[i] = (at, (self._period(), self._color.waiting[i][1][1]))
        if self._color.went_back:
            self._forget_later_than(accepted)
        return self._match(final=False)

    def add_depth(self, stamp: Stamp, depth: D) -> list[Pair[C, D]]:
        """Take the next depth image and return the pairs that are certain now, in the order of their stamps."""
        accepted = self._depth.feed(stamp, depth)
        if self._depth.went_back:
            self._forget_later_than(accepted)
        return self._match(final=False)

    def finish(self) -> list[Pair[C, D]]:
        """Return the last pairs when no more images come; what stays is single."""
        pairs = self._match(final=True)
        self._drop(self._color, len(self._color.waiting))
        self._drop(self._depth, len(self._depth.waiting))
        return pairs

    def _period(self) -> float:
        if self._fixed_period is not None:
            return self._fixed_period
        return float(median(self._intervals)) if len(self._intervals) >= 3 else _DEFAULT_PERIOD_NS

    def _match(self, final: bool) -> list[Pair[C, D]]:
        pairs: list[Pair[C, D]] = []
        colors, depths = self._color.waiting, self._depth.waiting
        while colors and depths:
            (color_stamp, (period, color)), (depth_stamp, depth) = colors[0], depths[0]
            apart = abs(color_stamp - depth_stamp)
            color_is_first = color_stamp <= depth_stamp
            if apart > period / 2:
                self._drop(self._color if color_is_first else self._depth, 1)
                continue
            # a rival is a later image of the stream that came first; regular intervals leave no room for one
            if 2 * apart > _SHORTEST_INTERVAL * period:
                stream = colors if color_is_first else depths
                if len(stream) < 2 and not final:
                    break
                if len(stream) >= 2 and abs(stream[1][0] - max(color_stamp, depth_stamp)) < apart:
                    self._drop(self._color if color_is_first else self._depth, 1)
                    continue
            colors.popleft()
            depths.popleft()
            leap = self._color.leapt or self._depth.leapt
            self._color.leapt = self._depth.leapt = False
            self.counters.pairs += 1
            pairs.append(Pair(color_stamp, color, depth_stamp, depth, leap))
        self._drop(self._color, len(colors) - self._capacity)
        self._drop(self._depth, len(depths) - self._capacity)
        return pairs

    def _forget_later_than(self, accepted: list[Stamp]) -> None:
        """After a leap back: what waits from before it can have no partner any more."""
        self._color.went_back = self._depth.went_back = False
        limit = accepted[-1] + LEAP_NS
        for stream in (self._color, self._depth):
            while stream.waiting and stream.waiting[0][0] > limit:
                self._drop(stream, 1)

    def _drop(self, stream: object, count: int) -> None:
        for _ in range(count):
            if stream is self._color:
                self._color.waiting.popleft()
                self.counters.color_single += 1
            else:
                self._depth.waiting.popleft()
                self.counters.depth_single += 1
