"""What a viewer that joins late may ask for: the way, the loops and what key frames saw, thinned, in bounded memory."""

import logging
import threading
from collections import deque
from collections.abc import Iterator

import numpy as np
import zenoh
from numpy.typing import NDArray

from odom.backend import Estimate
from odom.frame import Stamp
from odom.viewer.clouds import KEYFRAMES, KeyframeClouds
from odom.viewer.trail import Trail
from odom.wire import Message, Topics, codec, truth_history
from odom.wire.session import WireSession

Array = NDArray[np.float64]

_LOG = logging.getLogger(__name__)
_POSES = 2000
_RESTART_NS = 5_000_000_000
_LOOPS = 500


class History:
    """Answers queries on `<ns>/history`, `<ns>/path`, `<ns>/landmarks` and `<ns>/keyframes` with ordinary messages.

    The clouds of at most `KEYFRAMES` key frames are kept, evenly thinned: less than 8 MB.
    """

    def __init__(self, session: WireSession, topics: Topics) -> None:
        self._topics = topics
        self._odom = Trail(_POSES)
        self._truth: dict[str, Trail] = {}
        self._loops: deque[Message] = deque(maxlen=_LOOPS)
        self._map: dict[str, Message] = {}
        self._keyframes: KeyframeClouds[Message] = KeyframeClouds(KEYFRAMES)
        self._lock = threading.Lock()
        for key in (topics.history, topics.path, topics.landmarks, topics.keyframes):
            session.zenoh.declare_queryable(key, self._reply)

    def add(self, estimate: Estimate) -> None:
        """Remember the pose of a frame."""
        with self._lock:
            if estimate.T_odom_camera is not None:
                self._odom = _extended(self._odom, estimate.stamp, estimate.T_odom_camera)

    def keep_loop(self, message: Message) -> None:
        """Remember a loop candidate."""
        with self._lock:
            self._loops.append(message)

    def add_truth(self, body: str, stamp: Stamp, T_world_body: Array) -> None:
        """Remember a motion capture pose."""
        with self._lock:
            self._truth[body] = _extended(self._truth.get(body), stamp, T_world_body)

    def keep(self, message: Message) -> None:
        """Remember the latest message of its key."""
        with self._lock:
            self._map[message.topic] = message

    def wants_keyframe(self) -> bool:
        """Count a new key frame and return whether its cloud is to be made, published and kept."""
        with self._lock:
            return self._keyframes.wants()

    def keep_keyframe(self, message: Message) -> None:
        """Remember the cloud of a key frame."""
        with self._lock:
            self._keyframes.keep(message.stamp, message)

    def _reply(self, query: zenoh.Query) -> None:
        try:
            with query:
                for message in self._answers(str(query.key_expr)):
                    query.reply(message.topic, message.payload, encoding=f"application/cdr;{message.type_name}")
        except zenoh.ZError as error:
            _LOG.warning("query of %s not answered: %s (it must accept replies on any key)", query.key_expr, error)

    def _answers(self, key: str) -> Iterator[Message]:
        with self._lock:
            latest = self._map.get(key)
            odom, truth = self._odom.poses(), {body: trail.poses() for body, trail in self._truth.items()}
            loops = list(self._loops)
            keyframes = [self._keyframes[stamp] for stamp in self._keyframes]
        if latest is not None:
            yield latest
        if key == self._topics.keyframes:
            yield from keyframes
        if key != self._topics.history:
            return
        if odom:
            yield codec.encode_path(self._topics.odom_history, odom[-1][0], odom, self._topics.frame_odom)
        for body, poses in truth.items():
            yield codec.encode_path(truth_history(body), poses[-1][0], poses, "world")
        yield from loops


def _extended(trail: Trail | None, stamp: Stamp, T: Array) -> Trail:
    """Return the trail with one more pose, or where time went back, as when a recording is played again, a new one."""
    if trail is None or (trail.newest is not None and stamp < trail.newest - _RESTART_NS):
        trail = Trail(_POSES)
    trail.add(stamp, T)
    return trail
