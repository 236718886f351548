"""Publishes what the odometry says: poses every frame, words and pictures for eyes as often as eyes need them."""

import time
from collections.abc import Callable, Collection, Mapping

from odom.backend import Estimate, LoopCandidate, State
from odom.frame import Stamp
from odom.service.history import History
from odom.service.publication import feature_message, loop_messages, map_messages, pose_messages
from odom.service.settings import ServiceSettings
from odom.wire import Message, Topics, codec
from odom.wire.session import WireSession

_LEVEL = {State.TRACKING: 0, State.RECOVERED: 0, State.UNCERTAIN: 1, State.LOST: 2}
_STALE = 3


class Announcer:
    """Owns the publishers of one odometry process.

    What is published has been remembered before: who joins meanwhile may get it twice, but never not at all.
    """

    def __init__(self, session: WireSession, topics: Topics, settings: ServiceSettings) -> None:
        self._topics = topics
        self._settings = settings
        self._publisher = session.publisher(urgent=True)
        self._bulky = session.publisher()
        self._state: State | None = None
        self._status_due = 0.0
        self._features_due = 0.0
        self._map_due = 0.0
        self._map: dict[str, Message] = {}
        self._history = History(session, topics)

    def poses(self, estimate: Estimate) -> None:
        """Publish odom, pose and tf at once, and the loop candidates."""
        self._history.add(estimate)
        for message in pose_messages(self._topics, estimate):
            self._publisher.put(message)
        self.loops(estimate.loops)

    def loops(self, loops: Collection[LoopCandidate]) -> None:
        """Publish what was judged of places that look alike."""
        for message in loop_messages(self._topics, loops):
            self._history.keep_loop(message)
            self._publisher.put(message)

    def truth(self, body: str, pose: codec.StampedPose) -> None:
        """Remember a true pose for those who join late; its sender has published it."""
        self._history.add_truth(body, pose.stamp, pose.T_parent_child)

    def pictures(self, estimate: Estimate) -> None:
        """Publish features, and path and landmarks when they have changed, no oftener than the settings say."""
        now = time.monotonic()
        if now >= self._features_due and (features := feature_message(self._topics, estimate)) is not None:
            self._features_due = now + self._settings.features_period_s
            self._publisher.put(features)
        for message in map_messages(self._topics, estimate):
            self._map[message.topic] = message
        if self._map and now >= self._map_due:
            self.flush()
            self._map_due = now + self._settings.map_period_s

    def keyframe(self, cloud: Callable[[], Message]) -> None:
        """Publish the cloud of a key frame, made only if it is one of those that are shown."""
        if self._history.wants_keyframe():
            message = cloud()
            self._history.keep_keyframe(message)
            self._bulky.put(message)

    def flush(self) -> None:
        """Publish the path and the landmarks that were held back."""
        for message in self._map.values():
            self._history.keep(message)
            self._publisher.put(message)
        self._map.clear()

    def status_is_due(self, state: State | None) -> bool:
        """Whether the state has changed or the period is over."""
        return state is not self._state or time.monotonic() >= self._status_due

    def status(self, state: State | None, reason: str, values: Mapping[str, str]) -> None:
        """Publish the state (None: no frame yet, or none for long) with its reason and values."""
        self._state = state
        self._status_due = time.monotonic() + self._settings.status_period_s
        level = _STALE if state is None else _LEVEL[state]
        text = reason or (state.value if state is not None else "")
        stamp = Stamp(time.time_ns())
        status = codec.Status(stamp, f"{self._topics.namespace}/odometry", level, text, values)
        self._publisher.put(codec.encode_status(self._topics.status, status))
