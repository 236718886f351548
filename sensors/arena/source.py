"""The arena as a source of wire messages: recorded (as fast as acknowledged) or live (each message when it is due)."""

import heapq
import logging
import threading
import time
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from itertools import count, islice

from odom.errors import ConfigError
from odom.frame import Stamp
from odom.wire import Message, truth
from odom.wire.codec import encode_pose
from sensors.arena.frames import frame, hidden, prepare
from sensors.arena.motion_capture import RATE_HZ as MOCAP_HZ
from sensors.arena.motion_capture import mocap_pose
from sensors.arena.options import RATE_HZ, ArenaOptions
from sensors.encoder import ImageEncoder
from sensors.source import SourceOptions

log = logging.getLogger(__name__)

EXACT_BODY = "exact_camera"
MOCAP_FRAME = "mocap"
WORLD_FRAME = "arena"
MOCAP_PER_FRAME = round(MOCAP_HZ / RATE_HZ)
FRAMES_AHEAD = 3
"""Frames drawn before they are sent, of a recorded session: more need more memory, fewer leave a core idle."""
LIVE_FRAMES_AHEAD = 15
"""Frames drawn before they are due, of a live session: half a second in which the machine may be busy otherwise."""
START_IN_NS = 1_000_000_000
"""Nanoseconds from asking for a live session to its first frame: time enough to draw the frames ahead."""
LATE_S = 2.0 / RATE_HZ
"""Seconds after which a live frame whose drawing has not begun is left out, as a busy driver would do."""
_COMPLETE_AFTER = 0.95
"""Frame periods after a frame's stamp until which none of the next frame's messages is stamped."""


class ArenaSource:
    """The simulated sensor and motion capture; see `Source`."""

    def __init__(self, arena: ArenaOptions, options: SourceOptions) -> None:
        self._arena = arena
        self._options = options
        self._encoder = ImageEncoder(options, arena.jpeg_quality)
        self._closed = threading.Event()
        self._first = round(options.start * RATE_HZ)
        self.skipped = 0
        self.lossless = not options.live
        self.length: int | None = sum(not hidden(arena, k) for k in range(self._first, arena.frames))
        self._painter = ThreadPoolExecutor(1, "arena")
        self._painter.submit(prepare, arena).result()

    def messages(self) -> Iterator[Message]:
        """Yield calibration, colour, depth and truth in the order of their stamps."""
        arena = self._arena
        if self._options.live:
            begin = time.time_ns() + START_IN_NS - round(self._options.start * 1e9)
            arena = replace(arena, start=Stamp(begin))
        yield from self._encoder.info(arena.start, arena.told_camera)
        waiting: list[tuple[Stamp, int, Message]] = []
        serial = count()
        for index, drawn in self._drawn(arena):
            for message in drawn:
                heapq.heappush(waiting, (message.stamp, next(serial), message))
            is_last = index == arena.frames - 1
            complete = arena.start + round((index + _COMPLETE_AFTER) * 1e9 / RATE_HZ)
            while waiting and (is_last or waiting[0][0] <= complete) and not self._closed.is_set():
                yield self._due(heapq.heappop(waiting)[2])
            if self._closed.is_set():
                return

    def close(self) -> None:
        """End the session, and say how many frames were left out."""
        if self.skipped and not self._closed.is_set():
            log.warning("arena: %d frames were left out: they were not drawn in time", self.skipped)
        self._closed.set()

    def _drawn(self, arena: ArenaOptions) -> Iterator[tuple[int, list[Message]]]:
        """Yield each period's number and messages, while the next ones are drawn."""
        ahead: deque[Future[list[Message]]] = deque()
        indices = iter(range(self._first, arena.frames))
        for index in range(self._first, arena.frames):
            room = (LIVE_FRAMES_AHEAD if self._options.live else FRAMES_AHEAD) - len(ahead)
            ahead.extend(self._painter.submit(self._period, arena, later) for later in islice(indices, room))
            yield index, ahead.popleft().result()

    def _due(self, message: Message) -> Message:
        if self._options.live:
            self._closed.wait(max(0.0, (message.stamp - time.time_ns()) * 1e-9))
        return message

    def _period(self, arena: ArenaOptions, index: int) -> list[Message]:
        """Return what is captured in the period that begins with frame `index`; nothing once the session is closed."""
        if self._closed.is_set():
            return []
        messages = self._truth(arena, index)
        late_s = time.time() - (arena.start * 1e-9 + index / RATE_HZ)
        if self._options.live and late_s > LATE_S:
            self.skipped += 1
        elif not hidden(arena, index):
            shot = frame(arena, index)
            messages.append(self._encoder.color(shot.stamp, shot.rgb))
            messages.append(self._encoder.depth(shot.depth_stamp, shot.depth_mm))
            if arena.exact_truth:
                messages.append(encode_pose(truth(EXACT_BODY), shot.stamp, shot.T_world_camera, WORLD_FRAME))
        return messages

    def _truth(self, arena: ArenaOptions, index: int) -> list[Message]:
        numbers = range(index * MOCAP_PER_FRAME, (index + 1) * MOCAP_PER_FRAME) if arena.mocap else ()
        poses = [pose for k in numbers if (pose := mocap_pose(arena, k)) is not None]
        return [encode_pose(truth(arena.body), pose.stamp, pose.T_mocap_marker, MOCAP_FRAME) for pose in poses]


def open_arena(options: SourceOptions) -> ArenaSource:
    """Open the simulated laboratory. Raises ConfigError for options that do not fit."""
    return ArenaSource(arena_options(options), options)


def arena_options(options: SourceOptions) -> ArenaOptions:
    """Return the session that the options describe. Raises ConfigError for options that do not fit."""
    texts = {"sensor": options.sensor, "seed": str(options.seed), **dict(options.extra)}
    lengths = [length for length in (options.seconds, options.end) if length is not None]
    if lengths:
        texts["seconds"] = str(min(lengths))
    if options.color not in ("jpeg", "raw") or options.depth not in ("raw", "rvl", "png"):
        raise ConfigError(f"arena: color {options.color!r}, depth {options.depth!r}: give jpeg or raw; raw, rvl or png")
    return ArenaOptions.from_texts(texts)
