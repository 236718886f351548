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
from typing import Generic, TypeVar

from odom.frame import Stamp

C = TypeVar("C")
D = TypeVar("D")
T = TypeVar("T")

LEAP_NS = 1_000_000_000
_DEFAULT_PERIOD_NS = 1_000_000_000 / 30
_INTERVALS = 30
_ENOUGH_INTERVALS = 5
_LONG_QUANTILE, _SHORT_QUANTILE = 0.9, 0.25
_LONGEST = 1.3


@dataclass(frozen=True, eq=False)
class Pair(Generic[C, D]):
    """A colour and a depth image that belong together.

    `depth` is None for a colour image that stayed single, where those are asked for; `depth_stamp` is then its own.
    """

    color_stamp: Stamp
    color: C
    depth_stamp: Stamp
    depth: D | None


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


@dataclass(frozen=True, eq=False)
class _Waiting(Generic[T]):
    stamp: Stamp
    item: T
    period: float
    shortest: float


class _Stream(Generic[T]):
    """One stream of images behind the policy for bad stamps; each waits with the stream's intervals up to it."""

    def __init__(self, counters: PairingCounters) -> None:
        self.waiting: deque[_Waiting[T]] = deque()
        self.single = 0
        self.went_back = False
        self._counters = counters
        self._last: Stamp | None = None
        self._held: tuple[Stamp, T] | None = None
        self._intervals: deque[int] = deque(maxlen=_INTERVALS)

    def feed(self, stamp: Stamp, item: T) -> None:
        """Take an image, hold it, or count and drop it."""
        if self._held is not None:
            held, self._held = self._held, None
            if 0 < stamp - held[0] <= LEAP_NS:
                self.went_back = self._last is not None and held[0] < self._last
                self._counters.leaps += 1
                self._accept(*held)
                self._accept(stamp, item)
                return
            self._counters.stray += 1
        if self._last is not None:
            step = stamp - self._last
            if step == 0:
                self._counters.duplicate += 1
                return
            if -LEAP_NS <= step < 0:
                self._counters.backward += 1
                return
            if abs(step) > LEAP_NS:
                self._held = (stamp, item)
                return
        self._accept(stamp, item)

    def drop(self, count: int = 1) -> None:
        """Count the oldest waiting images as single."""
        for _ in range(count):
            self.waiting.popleft()
            self.single += 1

    def _accept(self, stamp: Stamp, item: T) -> None:
        if self._last is not None and 0 < stamp - self._last <= LEAP_NS:
            self._intervals.append(stamp - self._last)
        self._last = stamp
        period, shortest = _DEFAULT_PERIOD_NS, _DEFAULT_PERIOD_NS
        if len(self._intervals) >= _ENOUGH_INTERVALS:
            ordered = sorted(self._intervals)
            long, short = (ordered[int(q * (len(ordered) - 1))] for q in (_LONG_QUANTILE, _SHORT_QUANTILE))
            period, shortest = min(long, _LONGEST * short), ordered[0]
        self.waiting.append(_Waiting(stamp, item, period, shortest))


class Pairer(Generic[C, D]):
    """Pairs two streams; pure: its answer depends on what it was fed only.

    `period_s` is the colour period; None measures it: a long one (the 90 % quantile) of the last 30 intervals, since
    half of the interval around it is how far off an image can lie, but no more than 1.3 times a short one (25 %),
    since the longest are where images are missing; 1/30 s at the beginning. With `singles`, a colour image that has no
    depth image is returned too, in its place.
    """

    def __init__(self, period_s: float | None = None, capacity: int = 32, singles: bool = False) -> None:
        self._singles = singles
        self.counters = PairingCounters()
        self._fixed_period = None if period_s is None else period_s * 1e9
        self._capacity = capacity
        self._color: _Stream[C] = _Stream(self.counters)
        self._depth: _Stream[D] = _Stream(self.counters)

    @property
    def newest_color(self) -> tuple[Stamp, C] | None:
        """The newest colour image that waits, None where none does."""
        waiting = self._color.waiting
        return (waiting[-1].stamp, waiting[-1].item) if waiting else None

    def add_color(self, stamp: Stamp, color: C) -> list[Pair[C, D]]:
        """Take the next colour image and return the pairs that are certain now, in the order of their stamps."""
        self._color.feed(stamp, color)
        return self._match(final=False)

    def add_depth(self, stamp: Stamp, depth: D) -> list[Pair[C, D]]:
        """Take the next depth image and return the pairs that are certain now, in the order of their stamps."""
        self._depth.feed(stamp, depth)
        return self._match(final=False)

    def finish(self) -> list[Pair[C, D]]:
        """Return the last pairs when no more images come; what stays is single."""
        pairs = self._match(final=True)
        while self._color.waiting:
            self._leave_single(self._color, pairs)
        self._depth.drop(len(self._depth.waiting))
        self._count_single()
        return pairs

    def _match(self, final: bool) -> list[Pair[C, D]]:
        self._forget_what_a_leap_left()
        pairs: list[Pair[C, D]] = []
        colors, depths = self._color.waiting, self._depth.waiting
        while colors and depths:
            color, depth = colors[0], depths[0]
            apart = abs(color.stamp - depth.stamp)
            early: _Stream[C] | _Stream[D] = self._color if color.stamp <= depth.stamp else self._depth
            if apart > (self._fixed_period or color.period) / 2:
                self._leave_single(early, pairs)
                continue
            # a rival is a later image of the stream that came first; its regular intervals leave no room for one
            if 2 * apart >= early.waiting[0].shortest:
                if len(early.waiting) < 2 and not final:
                    break
                if len(early.waiting) >= 2 and abs(early.waiting[1].stamp - max(color.stamp, depth.stamp)) < apart:
                    self._leave_single(early, pairs)
                    continue
            colors.popleft()
            depths.popleft()
            self.counters.pairs += 1
            pairs.append(Pair(color.stamp, color.item, depth.stamp, depth.item))
        while len(colors) > self._capacity:
            self._leave_single(self._color, pairs)
        self._depth.drop(len(depths) - self._capacity)
        self._count_single()
        return pairs

    def _leave_single(self, stream: _Stream[C] | _Stream[D], pairs: list[Pair[C, D]]) -> None:
        """Give up on the oldest waiting image of a stream; a colour image may go out alone."""
        if self._singles and stream is self._color:
            color = self._color.waiting[0]
            pairs.append(Pair(color.stamp, color.item, color.stamp, None))
        stream.drop()

    def _forget_what_a_leap_left(self) -> None:
        """After a leap back: what waits from before it, in either stream, can have no partner any more."""
        for leapt in (self._color, self._depth):
            if not leapt.went_back:
                continue
            leapt.went_back = False
            limit = leapt.waiting[-1].stamp + LEAP_NS
            for stream in (self._color, self._depth):
                while stream.waiting and stream.waiting[0].stamp > limit:
                    stream.drop()

    def _count_single(self) -> None:
        self.counters.color_single, self.counters.depth_single = self._color.single, self._depth.single
