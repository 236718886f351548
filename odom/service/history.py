"""Answers viewers that join late: earlier poses, loop candidates and key-frame clouds, thinned, in bounded memory."""

import threading
from collections import deque
from collections.abc import Iterator
from functools import partial

import zenoh

from odom.backend import Estimate
from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.viewer.bounded_trajectory import RESTART_NS, BoundedTrajectory
from odom.viewer.keyframe_clouds import KEYFRAMES, KeyframeClouds
from odom.wire import Message, Topics, codec, truth_history
from odom.wire.delivery import encoding_of
from odom.wire.session import WireSession

_POSES = 2000
"""Poses kept of each trajectory, evenly thinned beyond: 0.3 MB each. Fewer draw a coarser line for late viewers."""
_LOOPS = 500
"""Newest loop candidates kept, as many as a viewer draws by default."""


class History:
    """Answers queries on `<ns>/history`, `<ns>/path`, `<ns>/landmarks` and `<ns>/keyframes` with ordinary messages.

    The clouds of at most `KEYFRAMES` key frames are kept, evenly thinned: less than 8 MB.
    """

    def __init__(self, session: WireSession, topics: Topics) -> None:
        self._topics = topics
        self._odom = BoundedTrajectory(_POSES)
        self._chain = BoundedTrajectory(_POSES)
        self._truth: dict[str, BoundedTrajectory] = {}
        self._loops: deque[Message] = deque(maxlen=_LOOPS)
        self._latest: dict[str, Message] = {}
        self._keyframes: KeyframeClouds[Message] = KeyframeClouds(KEYFRAMES)
        self._lock = threading.Lock()
        for key in (topics.history, topics.path, topics.landmarks, topics.keyframes):
            session.zenoh.declare_queryable(key, partial(self._reply, key))

    def add(self, estimate: Estimate) -> None:
        """Remember the pose of a frame."""
        with self._lock:
            if estimate.T_odom_camera is not None:
                self._odom = _extended(self._odom, estimate.stamp, estimate.T_odom_camera)

    def add_chain(self, estimate: Estimate) -> None:
        """Remember the chain's pose of a frame."""
        with self._lock:
            if estimate.chain is not None:
                self._chain = _extended(self._chain, estimate.stamp, estimate.chain.T_chain_camera)

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
            self._latest[message.topic] = message

    def forget(self, topic: str) -> None:
        """Drop the message of a key that has nothing more to show."""
        with self._lock:
            self._latest.pop(topic, None)

    def takes_next_keyframe(self) -> bool:
        """Count a new key frame and return whether its cloud is to be made, published and kept."""
        with self._lock:
            return self._keyframes.takes_next()

    def keep_keyframe(self, message: Message) -> None:
        """Remember the cloud of a key frame."""
        with self._lock:
            self._keyframes.keep(message.stamp, message)

    def _reply(self, key: str, query: zenoh.Query) -> None:
        """Answer a query that reached `key`, also by a wildcard; an answer that is not accepted becomes an error."""
        asked = str(query.key_expr)
        with query:
            try:
                for message in self._answers(key):
                    query.reply(message.topic, message.payload, encoding=encoding_of(message.type_name))
            except zenoh.ZError as error:
                query.reply_err(f"query of {asked} not answered in full: it must accept replies on any key ({error})")

    def _answers(self, key: str) -> Iterator[Message]:
        with self._lock:
            latest = [m for topic, m in self._latest.items() if topic == key or topic.startswith(f"{key}/")]
            odom, truth = self._odom.poses(), {body: kept.poses() for body, kept in self._truth.items()}
            chain, loops = self._chain.poses(), list(self._loops)
            keyframes = [self._keyframes[stamp] for stamp in self._keyframes]
        yield from latest
        if key == self._topics.keyframes:
            yield from keyframes
        if key != self._topics.history:
            return
        if odom:
            yield codec.encode_path(self._topics.odom_history, odom[-1][0], odom, self._topics.frame_odom)
        if chain:
            yield codec.encode_path(self._topics.chain_history, chain[-1][0], chain, self._topics.frame_odom)
        for body, poses in truth.items():
            yield codec.encode_path(truth_history(body), poses[-1][0], poses, "world")
        yield from loops


def _extended(kept: BoundedTrajectory | None, stamp: Stamp, T: Array) -> BoundedTrajectory:
    """Return the trajectory with one more pose; a new one where time went back (a recording is played again)."""
    if kept is None or (kept.newest is not None and stamp < kept.newest - RESTART_NS):
        kept = BoundedTrajectory(_POSES)
    kept.add(stamp, T)
    return kept
