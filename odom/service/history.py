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
from odom.service.publication import loop_messages
from odom.viewer.clouds import KEYFRAMES, KeyframeClouds
from odom.wire import Message, Topics, codec
from odom.wire.session import WireSession

Array = NDArray[np.float64]

_LOG = logging.getLogger(__name__)
_POSES = 2000
_LOOPS = 500


class Trail:
    """Poses spread evenly over a way of any length: when it is full, every second one goes."""

    def __init__(self, capacity: int = _POSES) -> None:
        self.poses: list[tuple[Stamp, Array]] = []
        self._capacity = capacity
        self._stride = 1
        self._seen = 0

    def add(self, stamp: Stamp, T: Array) -> None:
        """Take the next pose."""
        if self._seen % self._stride == 0:
            self.poses.append((stamp, T))
            if len(self.poses) >= self._capacity:
                self.poses = self.poses[::2]
                self._stride *= 2
        self._seen += 1


class History:
    """Answers queries on `<ns>/history`, `<ns>/path`, `<ns>/landmarks` and `<ns>/keyframes` with ordinary messages.

    The clouds of at most `KEYFRAMES` key frames are kept, evenly thinned: less than 8 MB.
    """

    def __init__(self, session: WireSession, topics: Topics) -> None:
        self._topics = topics
        self._odom = Trail()
        self._truth: dict[str, Trail] = {}
        self._loops: deque[Message] = deque(maxlen=_LOOPS)
        self._map: dict[str, Message] = {}
        self._keyframes: KeyframeClouds[Message] = KeyframeClouds(KEYFRAMES)
        self._lock = threading.Lock()
        for key in (f"{topics.namespace}/history", topics.path, topics.landmarks, topics.keyframes):
            session.zenoh.declare_queryable(key, self._reply)

    def add(self, estimate: Estimate) -> None:
        """Remember the pose and the loop candidates of a frame."""
        with self._lock:
            if estimate.T_odom_camera is not None:
                self._odom.add(estimate.stamp, estimate.T_odom_camera)
            self._loops.extend(loop_messages(self._topics, estimate))

    def add_truth(self, body: str, stamp: Stamp, T_world_body: Array) -> None:
        """Remember a motion capture pose."""
        with self._lock:
            self._truth.setdefault(body, Trail()).add(stamp, T_world_body)

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
            odom, truth = list(self._odom.poses), {body: list(trail.poses) for body, trail in self._truth.items()}
            loops = list(self._loops)
            keyframes = [self._keyframes[stamp] for stamp in self._keyframes]
        if latest is not None:
            yield latest
        if key == self._topics.keyframes:
            yield from keyframes
        if key != f"{self._topics.namespace}/history":
            return
        if odom:
            yield codec.encode_path(f"{key}/odom", odom[-1][0], odom, self._topics.frame_odom)
        for body, poses in truth.items():
            yield codec.encode_path(f"truth/{body}/history", poses[-1][0], poses, "world")
        yield from loops
