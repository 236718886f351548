"""A stretch of a source as received, with a record of what could not be used: the input of `odom doctor`."""

import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from itertools import islice, takewhile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from odom.errors import WireError
from odom.evaluation.diagnosis import Recording
from odom.evaluation.trajectory import Trajectory
from odom.frame import RgbdFrame, Stamp
from odom.service.progress import counting
from odom.wire import Message, Topics
from odom.wire.assembler import FrameAssembler
from odom.wire.codec import decode_color, decode_depth, decode_pose
from odom.wire.image_counts import STAMP_REASONS
from odom.wire.malformed_counter import MalformedCounter
from odom.wire.pairing import LEAP_NS, follows
from sensors.source import Source, refused_images

_MOST_FRAMES = 900
"""Frames kept in memory, 0.9 MB each: 30 s at 30 Hz, the longest that may be asked for."""
_RATE_HZ = 30
"""Frames a second of the usual sensor."""
_POLL_S = 0.05
"""Longest time until a request to end is noticed, in seconds."""
_SEARCHED, _ENOUGH_STAMPS = 20_000, 30
"""Messages, some minutes of them, in which a stream that is missing so far is searched, and stamps that suffice."""


def look_at(opened: Source, topics: Topics, seconds: float, is_stopped: Callable[[], bool]) -> Recording:
    """Return the first `seconds` of a source that was opened, or what came until it is stopped, and close it.

    Shows how far it is. Images that the source itself refused are counted.
    """
    looking = counting("looking", round(_RATE_HZ * seconds))
    with closing(opened), _closed_when(is_stopped, opened), looking as progress:
        messages = takewhile(lambda _: not is_stopped(), opened.messages())
        recording = collect(messages, topics, seconds, progress, opened.lossless)
    return replace(recording, refused={**recording.refused, **refused_images(opened)})


@contextmanager
def _closed_when(is_stopped: Callable[[], bool], source: Source) -> Iterator[None]:
    """Close the source as soon as it is stopped, within the block: it may be waiting for a device that is silent."""
    done = threading.Event()

    def watch() -> None:
        while not done.wait(_POLL_S):
            if is_stopped():
                source.close()
                return

    threading.Thread(target=watch, name="stop", daemon=True).start()
    try:
        yield
    finally:
        done.set()


def collect(
    messages: Iterable[Message],
    topics: Topics,
    seconds: float,
    progress: Callable[[int], None],
    is_recorded: bool = False,
) -> Recording:
    """Return the first `seconds` of colour, depth, calibration and truth from the messages of a source.

    Where only one of the two streams has come by then, the search for stamps of the other goes on in a recorded source.
    """
    messages = iter(messages)
    reasons = _Reasons()
    assembler = FrameAssembler(topics, grey=True, malformed=reasons)
    streams = {
        "colour": _Stream(topics.color_keys, decode_color),
        "depth": _Stream(topics.depth_keys, decode_depth),
    }
    color = streams["colour"].stamps
    frames: list[RgbdFrame] = []
    truth: dict[str, dict[Stamp, NDArray[np.float64]]] = {}
    for message in messages:
        for stream in streams.values():
            stream.take(message)
        if message.topic.startswith("truth/"):
            try:
                truth.setdefault(message.topic.split("/")[1], {})[message.stamp] = decode_pose(message).T_parent_child
            except WireError:
                continue
        frames += assembler.feed(message)
        progress(len(color))
        if streams["colour"].lasted_ns > seconds * 1e9 or max(len(frames), len(color)) >= _MOST_FRAMES:
            break
    frames += assembler.finish()
    missing = [stream for stream in streams.values() if not stream.stamps]
    if is_recorded and len(missing) == 1:
        for message in islice(messages, _SEARCHED):
            missing[0].take(message)
            if len(missing[0].stamps) >= _ENOUGH_STAMPS:
                break
    refused = Counter(
        {(name, why): n for (key, why), n in reasons.why.items() for name in streams if key in streams[name].keys}
    )
    camera, sizes = assembler.camera, {name: stream.size for name, stream in streams.items()}
    if len({*sizes.values(), *([(camera.width, camera.height)] if camera else [])} - {None}) > 1:
        refused.clear()  # images of another size than the others are no bad images
    color_stamps, depth_stamps = (_without_strays(stream.stamps) for stream in streams.values())
    trajectories = {body: Trajectory.by_stamp(poses) for body, poses in truth.items()}
    counts = {"colour": assembler.pairing.color, "depth": assembler.pairing.depth}
    stamps = {(name, why): n for name, c in counts.items() for why, n in c.refused.items() if why in STAMP_REASONS}
    return Recording(
        color_stamps,
        depth_stamps,
        tuple(frames),
        camera,
        trajectories,
        sizes["colour"],
        sizes["depth"],
        refused,
        stamps,
    )


class _Stream:
    """Stamps of a stream, how long they go on without leaps, and the size of its first image that can be decoded."""

    def __init__(self, keys: tuple[str, ...], decode: Callable[[Message], NDArray[Any]]) -> None:
        self.keys = keys
        self.stamps: list[int] = []
        self.lasted_ns = 0
        self.size: tuple[int, int] | None = None
        self._decode = decode

    def take(self, message: Message) -> None:
        if message.topic not in self.keys:
            return
        if self.stamps and follows(message.stamp, Stamp(self.stamps[-1])):
            self.lasted_ns += message.stamp - self.stamps[-1]
        self.stamps.append(message.stamp)
        if self.size is None:
            try:
                height, width = self._decode(message).shape[:2]
            except WireError:
                return
            self.size = width, height


def _without_strays(stamps: list[int]) -> NDArray[np.int64]:
    """Return the different stamps, sorted, without those far from all others, unless all are."""
    found = np.unique(np.array(stamps, dtype=np.int64))
    leaps = np.concatenate([[True], np.diff(found) > LEAP_NS, [True]])
    is_stray = leaps[:-1] & leaps[1:]
    return found if is_stray.all() else found[~is_stray]


class _Reasons(MalformedCounter):
    """Counts refused messages by key and reason."""

    def __init__(self) -> None:
        super().__init__()
        self.why: Counter[tuple[str, str]] = Counter()

    def add(self, key: str, why: str) -> None:
        super().add(key, why)
        self.why[key, why.removeprefix(f"{key}: ")] += 1
