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
from odom.wire.codec import (
    encode_camera_info,
    encode_color,
    encode_color_jpeg,
    encode_depth,
    encode_depth_compressed,
    encode_pose,
)
from sensors.arena.generate import ArenaFrame, frame, hidden, prepare
from sensors.arena.mocap import RATE_HZ as MOCAP_HZ
from sensors.arena.mocap import mocap_pose
from sensors.arena.options import RATE_HZ, ArenaOptions
from sensors.source import SourceOptions

log = logging.getLogger(__name__)

EXACT_BODY = "exact_camera"
MOCAP_FRAME = "mocap"
WORLD_FRAME = "arena"
MOCAP_A_FRAME = round(MOCAP_HZ / RATE_HZ)
FRAMES_AHEAD = 3
"""Frames drawn before they are sent, of a recorded session."""
LIVE_FRAMES_AHEAD = 15
"""Frames drawn before they are due, of a live session: no frame is lost while the machine is busy with other things."""
START_IN_NS = 1_000_000_000
"""A live session begins so long after it is asked for: time enough to draw the frames ahead."""
LATE_S = 2.0 / RATE_HZ
"""A live frame that could not be drawn until so long after it was due is left out, as a busy driver would."""


class ArenaSource:
    """The simulated sensor and motion capture; see `Source`."""

    def __init__(self, arena: ArenaOptions, options: SourceOptions) -> None:
        self._arena = arena
        self._options = options
        self._closed = threading.Event()
        self.skipped = 0
        self._first = round(options.start * RATE_HZ)
        self._artist = ThreadPoolExecutor(1, "arena")
        self._artist.submit(prepare, arena).result()

    @property
    def lossless(self) -> bool:
        """False when live."""
        return not self._options.live

    @property
    def length(self) -> int | None:
        """Colour frames of the session."""
        return sum(not hidden(self._arena, k) for k in range(self._first, self._arena.frames))

    def messages(self) -> Iterator[Message]:
        """Yield calibration, colour, depth and truth in the order of their stamps."""
        arena = self._arena
        if self._options.live:
            begin = time.time_ns() + START_IN_NS - round(self._options.start * 1e9)
            arena = replace(arena, start=Stamp(begin))
        yield encode_camera_info(
            self._options.topics.camera_info, arena.start, arena.camera, self._options.topics.frame_camera
        )
        waiting: list[tuple[Stamp, int, Message]] = []
        serial = count()
        for index, drawn in self._drawn(arena):
            for message in drawn:
                heapq.heappush(waiting, (message.stamp, next(serial), message))
            sure = arena.start + round((index + 0.95) * 1e9 / RATE_HZ)
            while waiting and waiting[0][0] <= sure and not self._closed.is_set():
                yield self._due(heapq.heappop(waiting)[2])
            if self._closed.is_set():
                return
        while waiting and not self._closed.is_set():
            yield self._due(heapq.heappop(waiting)[2])

    def close(self) -> None:
        """End the session, and say how many frames were left out."""
        if self.skipped and not self._closed.is_set():
            log.warning("arena: %d frames were left out: they were not drawn in time", self.skipped)
        self._closed.set()

    def _drawn(self, arena: ArenaOptions) -> Iterator[tuple[int, list[Message]]]:
        """Yield each period's number and messages, while the next ones are drawn."""
        room = LIVE_FRAMES_AHEAD if self._options.live else FRAMES_AHEAD
        ahead: deque[Future[list[Message]]] = deque()
        indices = iter(range(self._first, arena.frames))
        for index in range(self._first, arena.frames):
            for next_index in islice(indices, room - len(ahead)):
                ahead.append(self._artist.submit(self._period, arena, next_index))
            yield index, ahead.popleft().result()

    def _due(self, message: Message) -> Message:
        if self._options.live:
            self._closed.wait(max(0.0, (message.stamp - time.time_ns()) * 1e-9))
        return message

    def _period(self, arena: ArenaOptions, index: int) -> list[Message]:
        """Return what is captured in the period that begins with frame `index`; nothing once the session is closed."""
        if self._closed.is_set():
            return []
        messages = list(self._truth(arena, index))
        late_s = time.time() - (arena.start * 1e-9 + index / RATE_HZ)
        if self._options.live and late_s > LATE_S:
            self.skipped += 1
        elif not hidden(arena, index):
            messages += self._images(frame(arena, index))
        return messages

    def _images(self, shot: ArenaFrame) -> Iterator[Message]:
        topics = self._options.topics
        if self._options.color == "jpeg":
            quality = self._arena.jpeg_quality
            yield encode_color_jpeg(topics.color_compressed, shot.stamp, shot.rgb, topics.frame_camera, quality)
        else:
            yield encode_color(topics.color, shot.stamp, shot.rgb, topics.frame_camera)
        if self._options.depth == "raw":
            yield encode_depth(topics.depth, shot.depth_stamp, shot.depth_mm, topics.frame_camera)
        else:
            codec = self._options.depth
            yield encode_depth_compressed(
                topics.depth_compressed, shot.depth_stamp, shot.depth_mm, topics.frame_camera, codec
            )
        if self._arena.exact_truth:
            yield encode_pose(truth(EXACT_BODY), shot.stamp, shot.T_world_camera, WORLD_FRAME)

    def _truth(self, arena: ArenaOptions, index: int) -> Iterator[Message]:
        if not arena.mocap:
            return
        for k in range(index * MOCAP_A_FRAME, (index + 1) * MOCAP_A_FRAME):
            pose = mocap_pose(arena, k)
            if pose is not None:
                yield encode_pose(truth(arena.body), pose.stamp, pose.T_mocap_marker, MOCAP_FRAME)


def arena_options(options: SourceOptions) -> ArenaOptions:
    """Return the arena that the options of a source describe. Raises ConfigError for what does not fit."""
    texts = {"sensor": options.sensor, "seed": str(options.seed), **dict(options.extra)}
    seconds = options.end if options.seconds is None else options.seconds
    if seconds is not None:
        texts["seconds"] = str(seconds)
    if options.color not in ("jpeg", "raw") or options.depth not in ("raw", "rvl", "png"):
        raise ConfigError(f"arena: color {options.color!r}, depth {options.depth!r}: give jpeg or raw; raw, rvl or png")
    return ArenaOptions.from_texts(texts)


def open_arena(options: SourceOptions) -> ArenaSource:
    """Open the simulated laboratory. Raises ConfigError for options that do not fit."""
    return ArenaSource(arena_options(options), options)
