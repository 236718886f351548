"""Which depth image belongs to which colour image.

A camera takes colour and depth images at different times. Each depth image is paired with the nearest colour image
within half a period, one to one. The outcome depends on the stamps and the order within each stream, not on when a
message arrives, as long as neither stream is more than `capacity` images ahead of the other.

Bad stamps are counted and treated as follows. One equal to the stream's last is a duplicate and dropped. One before
it, by up to a second, goes backward and is dropped. One more than a second away in either direction is a leap, which
is held until the next image of its stream: if that follows it, both are taken (after a leap back the images that wait
in either stream are given up); if not, it is dropped as a stray.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from odom.frame import Stamp
from odom.wire.image_counts import BACKWARD, DUPLICATE, NO_COLOR, SET_BACK, STRAY, ImageCounts

C = TypeVar("C")
D = TypeVar("D")
T = TypeVar("T")

LEAP_NS = 1_000_000_000
"""Nanoseconds between two stamps of a stream beyond which the clock has leapt. Smaller: a camera that pauses counts as
one that leaps; larger: the stream stands still for longer after a step back."""
_DEFAULT_PERIOD_NS = 1_000_000_000 / 30
"""Period of a stream until five intervals are known: a camera of 30 Hz."""
_INTERVALS, _ENOUGH_INTERVALS = 30, 5
"""The last intervals from which the period is measured, and how many are needed. More: a change of rate is noticed
later; fewer: the quantiles below are uncertain. Chosen by hand."""
_LONG_QUANTILE, _SHORT_QUANTILE, _LONGEST = 0.9, 0.25, 1.3
"""The period is the long quantile of the intervals, at most 1.3 times the short one. An image can lie half of the
interval around it from its partner, so the period must be a long one; but the longest intervals are where images are
missing. Larger: images pair across a gap; smaller: uneven ones stay single. Chosen with tests/wire/test_pairing.py."""


def follows(stamp: Stamp, before: Stamp) -> bool:
    """Return whether a stream's stamp goes on from the one before it, without a leap."""
    return 0 < stamp - before <= LEAP_NS


@dataclass(frozen=True, eq=False)
class Pair(Generic[C, D]):
    """A colour and a depth image that belong together.

    `depth` is None for a colour image that stayed single; `depth_stamp` is then its own.
    """

    color_stamp: Stamp
    color: C
    depth_stamp: Stamp
    depth: D | None


@dataclass
class PairingCounters:
    """What became of the images of both streams, how many came out in pairs, and how often the stamps leapt.

    `color_single` counts the colour images that came out alone.
    """

    color: ImageCounts = field(default_factory=ImageCounts)
    depth: ImageCounts = field(default_factory=ImageCounts)
    pairs: int = 0
    color_single: int = 0
    leaps: int = 0


@dataclass(frozen=True, eq=False)
class _WaitingImage(Generic[T]):
    """An image with the period and the shortest interval (ns) of its stream up to it."""

    stamp: Stamp
    item: T
    period: float
    shortest: float


class _ImageStream(Generic[T]):
    """One stream of images, without those of bad stamps."""

    def __init__(self, counts: ImageCounts) -> None:
        self.waiting: deque[_WaitingImage[T]] = deque()
        self.counts = counts
        self.went_back = False
        self.leaps = 0
        self._last: Stamp | None = None
        self._held: tuple[Stamp, T] | None = None
        self._intervals: deque[int] = deque(maxlen=_INTERVALS)

    def feed(self, stamp: Stamp, item: T) -> None:
        """Take an image, hold it, or count and drop it."""
        self.counts.given += 1
        if self._held is not None:
            held, self._held = self._held, None
            if follows(stamp, held[0]):
                self.went_back = self._last is not None and held[0] < self._last
                self.leaps += 1
                self._accept(*held)
                self._accept(stamp, item)
                return
            self.counts.refuse(STRAY)
        step = 1 if self._last is None else stamp - self._last
        if step == 0:
            self.counts.refuse(DUPLICATE)
        elif -LEAP_NS <= step < 0:
            self.counts.refuse(BACKWARD)
        elif abs(step) > LEAP_NS:
            self._held = (stamp, item)
        else:
            self._accept(stamp, item)

    def finish(self) -> None:
        """Count an image that is still held: nothing follows it."""
        if self._held is not None:
            self._held = None
            self.counts.refuse(STRAY)

    def take(self) -> _WaitingImage[T]:
        """Return the oldest waiting image, which is used."""
        self.counts.used += 1
        return self.waiting.popleft()

    def drop(self, reason: str) -> None:
        """Count the oldest waiting image as refused."""
        self.counts.refuse(reason)
        self.waiting.popleft()

    def _accept(self, stamp: Stamp, item: T) -> None:
        if self._last is not None and follows(stamp, self._last):
            self._intervals.append(stamp - self._last)
        self._last = stamp
        period, shortest = _DEFAULT_PERIOD_NS, _DEFAULT_PERIOD_NS
        if len(self._intervals) >= _ENOUGH_INTERVALS:
            ordered = sorted(self._intervals)
            long, short = (ordered[int(q * (len(ordered) - 1))] for q in (_LONG_QUANTILE, _SHORT_QUANTILE))
            period, shortest = min(long, _LONGEST * short), ordered[0]
        self.waiting.append(_WaitingImage(stamp, item, period, shortest))


class Pairer(Generic[C, D]):
    """Pairs two streams of images; `counters` say what became of them.

    A colour image that has no depth image is returned too, in its place. Beyond `capacity` waiting images of a stream,
    32 or about one second, the oldest are given up.
    """

    def __init__(self, capacity: int = 32) -> None:
        self.counters = PairingCounters()
        self._capacity = capacity
        self._color: _ImageStream[C] = _ImageStream(self.counters.color)
        self._depth: _ImageStream[D] = _ImageStream(self.counters.depth)

    @property
    def newest_color(self) -> tuple[Stamp, C] | None:
        """The newest colour image that waits, None without one."""
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
        """Return the last pairs when no more images come; what remains is single."""
        self._color.finish()
        self._depth.finish()
        return self._match(final=True)

    def _match(self, final: bool) -> list[Pair[C, D]]:
        self._give_up_what_waits_from_before_a_leap_back()
        pairs: list[Pair[C, D]] = []
        colors, depths = self._color.waiting, self._depth.waiting
        while colors and depths:
            color, depth = colors[0], depths[0]
            apart = abs(color.stamp - depth.stamp)
            early: _ImageStream[C] | _ImageStream[D] = self._color if color.stamp <= depth.stamp else self._depth
            if apart > color.period / 2:
                self._leave_single(early, pairs)
                continue
            # The next image of the early stream may be nearer to the late one. It cannot be if that stream's intervals
            # are longer than twice this distance; otherwise it must be seen before the pair is certain.
            if 2 * apart >= early.waiting[0].shortest:
                if len(early.waiting) < 2 and not final:
                    break
                if len(early.waiting) >= 2 and abs(early.waiting[1].stamp - max(color.stamp, depth.stamp)) < apart:
                    self._leave_single(early, pairs)
                    continue
            self._color.take()
            self._depth.take()
            self.counters.pairs += 1
            pairs.append(Pair(color.stamp, color.item, depth.stamp, depth.item))
        capacity = 0 if final else self._capacity
        while len(colors) > capacity:
            self._leave_single(self._color, pairs)
        while len(depths) > capacity:
            self._leave_single(self._depth, pairs)
        self.counters.leaps = self._color.leaps + self._depth.leaps
        return pairs

    def _leave_single(self, stream: _ImageStream[C] | _ImageStream[D], pairs: list[Pair[C, D]]) -> None:
        """Give up the oldest waiting image of a stream; a colour image is returned alone."""
        if stream is not self._color:
            stream.drop(NO_COLOR)
            return
        self.counters.color_single += 1
        color = self._color.take()
        pairs.append(Pair(color.stamp, color.item, color.stamp, None))

    def _give_up_what_waits_from_before_a_leap_back(self) -> None:
        for leapt in (self._color, self._depth):
            if not leapt.went_back:
                continue
            leapt.went_back = False
            limit = leapt.waiting[-1].stamp + LEAP_NS
            for stream in (self._color, self._depth):
                while stream.waiting and stream.waiting[0].stamp > limit:
                    stream.drop(SET_BACK)
