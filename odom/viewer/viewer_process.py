"""The viewer's process: passes messages from Zenoh to Rerun. It never acknowledges, so that no sender waits for it."""

import logging
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue

import rerun as rr
import zenoh

from odom.errors import WireError
from odom.viewer.blueprint import blueprint
from odom.viewer.entities import EntityUpdate, log_to
from odom.viewer.image_rate import ImageRateLimit
from odom.viewer.outputs import Outputs, open_outputs
from odom.viewer.scene import Scene
from odom.viewer.settings import ViewerSettings
from odom.wire import TRUTH, Topics, WireSettings
from odom.wire.delivery import delivery_of
from odom.wire.publisher import is_matched
from odom.wire.session import Subscriber, WireSession, open_session
from odom.wire.unheard import Unheard

_LOG = logging.getLogger(__name__)
_NICE = 10
"""Niceness: on a busy machine the odometry goes first."""
_WAIT_S = 0.01
"""Longest wait for an image; small messages wait as long."""
_SMALL_AT_ONCE = 200
"""Small messages shown before the next image: fewer lag behind motion capture at 240 Hz, more starve the images."""
_SMALL_WAITING = 512
"""Small messages that may wait, two seconds of them; then the oldest are dropped."""
_HISTORY_S = 2.0
"""Wait for the next answer about earlier poses; where no odometry answers, the viewer opens this much later."""
_FOUND_S = 1.0
"""Wait until somebody who answers is known: a session that was just opened does not know of all others yet."""
_WHOLE_HISTORY_S = 60.0
"""Wait for all answers of a kind: a hundred clouds take seconds on a busy machine, and the rest would never come."""
_REPEAT_S = 20.0
"""Between two drawings of everything for browsers that open late, when Rerun's server has forgotten the first."""
_LAST_WORDS_S = 1.0
"""Time for messages that wait when the viewer is asked to end: on a busy machine all would take half a minute."""
_GRACE_S = 2.0
"""Wait after the end of the source for the odometry's last messages, before a viewer that only writes a file ends."""


def view(
    wire: WireSettings,
    settings: ViewerSettings,
    outputs: Outputs,
    stop: threading.Event,
    tell_address: Callable[[str], None],
) -> None:
    """Show one device until `stop` is set or the window is closed; with a file alone until the source has ended.

    Raises OdomError when an output, the window or the session cannot be opened, or the file not be written;
    ConfigError when there is a file of its name that may not be replaced.
    """
    if hasattr(os, "nice"):
        os.nice(_NICE)
    topics = Topics(wire.namespace)
    with open_session(wire.as_guest()) as session, open_outputs(outputs, settings, wire.namespace) as opened:
        if opened.address is not None:
            tell_address(opened.address)
        viewer = Viewer(session, topics, settings, opened.recording)
        viewer.start()
        session.announce(topics.alive_of("viewer"))
        while not (stop.is_set() or opened.closed):
            viewer.step(stop.is_set, repeat=outputs.served)
            if not outputs.served and viewer.ended_s is not None and time.monotonic() - viewer.ended_s > _GRACE_S:
                break
        viewer.finish()
        _LOG.info(
            "%d messages shown, %d images thinned out, %d messages dropped or lost, %d malformed", *viewer.counts()
        )


@dataclass
class Viewer:
    """Two subscriptions: images, of which only the newest waits, and all small messages."""

    session: WireSession
    topics: Topics
    settings: ViewerSettings
    recording: rr.RecordingStream
    ended_s: float | None = None

    def __post_init__(self) -> None:
        self._scene = Scene(self.topics, self.settings)
        self._timeline = self._scene.timeline
        self._rate_limit = ImageRateLimit(self.settings.image_rate_hz)
        self._shown_messages = 0
        self._repeat_due = time.monotonic() + _REPEAT_S
        self._unheard = Unheard(self.session, self.topics)
        t = self.topics
        small = (t.camera_info, t.odom, t.pose, t.path, t.loops, t.status, t.features, t.landmarks, t.keyframes, t.end)
        more = (f"{t.path}/*", t.chain, t.chain_closed, t.moving, TRUTH)
        self._small = self.session.subscriber((*small, *more), depth=_SMALL_WAITING)
        self._images = self.session.subscriber((*t.color_keys, *t.depth_keys), depth=1)

    def start(self) -> None:
        """Show what is static, and what happened before this viewer started."""
        self._draw(self._scene.setup())
        count = 0
        for sample in self._past():
            count += 1
            try:
                message = delivery_of(str(sample.key_expr), None, sample).message
                if message.topic in (self.topics.odom_history, self.topics.chain_history) or message.topic.endswith(
                    "/history"
                ):
                    self._scene.history(message)
                else:
                    self._draw(self._scene.handle(message))
            except WireError as error:
                _LOG.warning("the history has a malformed message: %s", error)
        self._draw(self._scene.everything())
        _LOG.info("showing %s, with %d messages of what happened before", self.topics.namespace, count)

    def step(self, is_asked_to_end: Callable[[], bool], repeat: bool) -> None:
        """Show the small messages that wait, then one image; with `repeat` everything again every 20 s.

        It returns between two messages when it is asked to end.
        """
        for _ in range(_SMALL_AT_ONCE):
            if is_asked_to_end() or not self._next(self._small, 0.0):
                break
        if is_asked_to_end():
            return
        self._next(self._images, _WAIT_S)
        if not self._shown_messages:
            self._unheard.look()
        if repeat and time.monotonic() >= self._repeat_due:
            self._repeat_due = time.monotonic() + _REPEAT_S
            self._draw(self._scene.everything())
        frame, timeline = self._scene.new_frame(), self._scene.timeline
        if frame is not None or timeline != self._timeline:
            self._timeline = timeline
            self.recording.send_blueprint(blueprint(frame, timeline))

    def finish(self) -> None:
        """Take no new messages; show for at most a second what still waits, then the trajectories as they now are."""
        self._small.close()
        self._images.close()
        deadline = time.monotonic() + _LAST_WORDS_S
        self.step(lambda: time.monotonic() > deadline, repeat=False)
        self._draw(self._scene.trajectories())

    def counts(self) -> tuple[int, int, int, int]:
        """Return messages shown, images thinned out, messages dropped here or lost on the way, and malformed ones."""
        small, images = self._small.total(), self._images.total()
        dropped = small.dropped + small.lost + images.dropped + images.lost
        malformed = self._small.malformed.counts.total() + self._images.malformed.counts.total()
        return self._shown_messages, self._rate_limit.thinned, dropped, malformed

    def _next(self, subscriber: Subscriber, timeout: float) -> bool:
        delivery = subscriber.receive(timeout)
        if delivery is None:
            return False
        message = delivery.message
        if subscriber is self._images:
            kind = "depth" if message.topic in self.topics.depth_keys else "color"
            if not self._rate_limit.takes(kind, message.stamp, time.monotonic()):
                return True
        try:
            self._draw(self._scene.handle(message))
            self._shown_messages += 1
        except WireError as error:
            subscriber.malformed.add(message.topic, str(error))
        if message.topic == self.topics.end:
            self.ended_s = self._repeat_due = time.monotonic()
        elif message.topic == self.topics.odom:
            self.ended_s = None
        return True

    def _draw(self, items: Iterable[EntityUpdate]) -> None:
        for item in items:
            log_to(self.recording, item, self._scene.timeline)

    def _past(self) -> Iterator[zenoh.Sample]:
        keys = (self.topics.history, self.topics.path, self.topics.landmarks, self.topics.keyframes)
        self._await_answerer(keys)
        for key in keys:
            every = zenoh.ConsolidationMode.NONE  # otherwise only the last message of a key would come
            replies: SimpleQueue[zenoh.Reply | None] = SimpleQueue()
            handler = zenoh.handlers.Callback(replies.put, partial(replies.put, None))
            self.session.zenoh.get(f"{key}?_anyke", handler, timeout=_WHOLE_HISTORY_S, consolidation=every)
            yield from _until_silent(replies)

    def _await_answerer(self, keys: Sequence[str]) -> None:
        """Return when somebody who answers questions about one of the `keys` is known, or after a second."""
        with ExitStack() as declared:
            asked = [declared.enter_context(self.session.zenoh.declare_querier(key)) for key in keys]
            until = time.monotonic() + _FOUND_S
            while time.monotonic() < until and not any(map(is_matched, asked)):
                time.sleep(_WAIT_S)


def _until_silent(replies: SimpleQueue[zenoh.Reply | None]) -> Iterator[zenoh.Sample]:
    """Yield good answers until there are no more, or the next one is not here in time."""
    with suppress(Empty):
        while (reply := replies.get(timeout=_HISTORY_S)) is not None:
            if reply.ok is not None:
                yield reply.ok
