"""Publishes the odometry's results: poses with every frame, status and pictures as often as the settings say."""

import time
from collections.abc import Callable, Collection, Mapping

from odom.backend import ClosedChain, Estimate, LoopCandidate, State
from odom.frame import Stamp
from odom.frontend.matching.moving_surfaces import MovingCells
from odom.service.estimate_messages import (
    chain_message,
    closed_chain_message,
    feature_message,
    landmark_message,
    loop_messages,
    moving_message,
    pose_messages,
)
from odom.service.history import History
from odom.service.path_topics import PathTopics
from odom.service.settings import ServiceSettings
from odom.wire import Message, Topics, codec
from odom.wire.codec import cdr
from odom.wire.publisher import Mirror
from odom.wire.session import WireSession

_LEVEL = {State.TRACKING: 0, State.RECOVERED: 0, State.UNCERTAIN: 1, State.LOST: 2}
"""diagnostic_msgs/DiagnosticStatus: OK, WARN, ERROR."""
_STALE = 3
"""STALE, the level of a status without a frame."""


class EstimatePublisher:
    """Owns the publishers of one odometry process.

    Each message is remembered for late viewers before it is published: one that joins in between may get it twice, but
    does not miss it. `mirror` is given every message, too.
    """

    def __init__(
        self, session: WireSession, topics: Topics, settings: ServiceSettings, mirror: Mirror | None = None
    ) -> None:
        self._topics = topics
        self._settings = settings
        self._publisher = session.publisher(urgent=True, mirror=mirror)
        self._bulky = session.publisher(mirror=mirror)
        self._state: State | None = None
        self._moving: MovingCells | None = None
        self._status_due = 0.0
        self._features_due = 0.0
        self._map_due = 0.0
        self._held_back: dict[str, Message] = {}
        self._paths = PathTopics(topics)
        self._history = History(session, topics)

    def publish_pose(self, estimate: Estimate) -> None:
        """Publish odom, pose and tf at once, as far as anyone takes them."""
        self._history.add(estimate)
        for message in pose_messages(self._topics, estimate, self._publisher.is_heard):
            self._publisher.put(message)

    def publish_chain(self, estimate: Estimate) -> None:
        """Publish the chain's pose, if anyone takes it."""
        self._history.add_chain(estimate)
        message = chain_message(self._topics, estimate, self._publisher.is_heard)
        if message is not None:
            self._publisher.put(message)

    def publish_loops(self, loops: Collection[LoopCandidate]) -> None:
        """Publish the loop candidates with their verdicts."""
        for message in loop_messages(self._topics, loops):
            self._history.keep_loop(message)
            self._publisher.put(message)

    def publish_closed_chain(self, closed: ClosedChain | None) -> None:
        """Publish the closed chain, if there is one."""
        if closed is not None:
            self._publisher.put(closed_chain_message(self._topics, closed))

    def remember_truth(self, body: str, pose: codec.StampedPose) -> None:
        """Remember a true pose for late viewers; its sender has published it."""
        self._history.add_truth(body, pose.stamp, pose.T_parent_child)

    def publish_display(self, estimate: Estimate) -> None:
        """Publish features if anyone takes them, and paths and landmarks when they have changed, not too often."""
        now = time.monotonic()
        if now >= self._features_due and self._publisher.is_heard(self._topics.features, cdr.POINT_CLOUD):
            features = feature_message(self._topics, estimate)
            if features is not None:
                self._features_due = now + self._settings.features_period_s
                self._publisher.put(features)
        self._publish_moving(estimate)
        for message in (*self._paths.messages(estimate), landmark_message(self._topics, estimate)):
            if message is not None:
                self._held_back.pop(message.topic, None)  # goes to the end: messages of one estimate in order
                self._held_back[message.topic] = message
        if self._held_back and now >= self._map_due:
            self.flush()
            self._map_due = now + self._settings.map_period_s

    def _publish_moving(self, estimate: Estimate) -> None:
        """Publish what moves whenever that was looked at again, and once more when nothing does any longer."""
        moving = estimate.moving
        if moving is None or moving is self._moving:
            return
        was_shown, self._moving = self._moving is not None and self._moving.mask.any(), moving
        if was_shown or moving.mask.any():
            self._publisher.put(moving_message(self._topics, estimate.stamp, moving))

    def publish_keyframe(self, cloud: Callable[[], Message]) -> None:
        """Publish the cloud of a key frame, which is only computed if it is one of those that are shown."""
        if self._history.takes_next_keyframe():
            message = cloud()
            self._history.keep_keyframe(message)
            self._bulky.put(message)

    def flush(self) -> None:
        """Publish the paths and the landmarks that were held back."""
        for message in self._held_back.values():
            if message.topic == self._topics.landmarks or self._paths.holds(message.topic):
                self._history.keep(message)
            else:
                self._history.forget(message.topic)
            self._publisher.put(message)
        self._held_back.clear()

    def status_is_due(self, state: State | None) -> bool:
        """Whether the state has changed or the settings' period is over."""
        return state is not self._state or time.monotonic() >= self._status_due

    def publish_status(self, state: State | None, reason: str, values: Mapping[str, str]) -> None:
        """Publish the state (None: no frame yet, or none for long) with its reason and values."""
        self._state = state
        self._status_due = time.monotonic() + self._settings.status_period_s
        level = _STALE if state is None else _LEVEL[state]
        text = reason or (state.value if state is not None else "")
        stamp = Stamp(time.time_ns())
        status = codec.Status(stamp, f"{self._topics.namespace}/odometry", level, text, values)
        self._publisher.put(codec.encode_status(self._topics.status, status))
