import threading
import time

import pytest
from made_up_messages import session_messages
from private_network import OpenSession

from odom.frame import Stamp
from odom.wire import Message, Topics
from odom.wire.codec import encode_text
from odom.wire.consumer import Consumer
from odom.wire.send_window import SendWindow
from odom.wire.session import Publisher, WireSession

TOPICS = Topics()
KEYS = (TOPICS.color_compressed, TOPICS.depth, TOPICS.camera_info, "truth/**")


class Sender:
    """What the sensor process does, with the most frames ever in flight."""

    def __init__(self, session: WireSession) -> None:
        self.publisher: Publisher = session.publisher(lossless=True)
        self.window = SendWindow(session, TOPICS, self.publisher)
        self.stop = threading.Event()
        self.sent = 0

    def send(self, messages: list[Message]) -> None:
        for message in messages:
            if not self.window.wait_for_room(self.stop):
                return
            self.window.sent(self.publisher.put(message), message.topic == TOPICS.color_compressed)
            self.sent += 1
        self.publisher.put(encode_text(TOPICS.end, Stamp(0), "done"))
        self.window.wait_until_consumed(self.stop)


def start(sender: Sender, messages: list[Message]) -> threading.Thread:
    thread = threading.Thread(target=sender.send, args=(messages,), daemon=True)
    thread.start()
    return thread


def test_two_consumers_of_unequal_speed_get_everything_in_order(open_peer: OpenSession) -> None:
    messages = session_messages(40)
    sender = Sender(open_peer())
    consumers = [Consumer(open_peer(), TOPICS, name, KEYS) for name in ("odometry", "recorder")]
    assert sender.window.wait_for_consumers(2, sender.stop)
    received: list[list[Message]] = [[], []]

    def consume(index: int) -> None:
        while (delivery := consumers[index].receive(30.0)) is not None:
            received[index].append(delivery.message)
            time.sleep(0.004 * index)

    threads = [threading.Thread(target=consume, args=(i,)) for i in range(2)]
    for thread in (*threads, sending := start(sender, messages)):
        thread.is_alive() or thread.start()
    for thread in (*threads, sending):
        thread.join(60.0)
    assert received == [messages, messages]
    assert [consumer.ended for consumer in consumers] == ["done", "done"]
    assert [consumer.total().lost + consumer.total().dropped for consumer in consumers] == [0, 0]


def test_at_most_four_frames_are_in_flight(open_peer: OpenSession) -> None:
    sender = Sender(open_peer())
    consumer = Consumer(open_peer(), TOPICS, "odometry", KEYS)
    sender.window.wait_for_consumers(1, sender.stop)
    sending = start(sender, session_messages(20))
    time.sleep(0.5)
    assert sender.sent <= 1 + 3 * 4 + 1
    frames = 0
    while (delivery := consumer.receive(30.0)) is not None:
        frames += delivery.message.topic == TOPICS.color_compressed
        assert sender.sent <= 1 + 3 * (frames + 4) + 1
    assert frames == 20
    sending.join(30.0)
    assert not sending.is_alive()


def test_while_there_is_room_acknowledgements_are_not_looked_at(
    open_peer: OpenSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    sender = Sender(open_peer())
    consumer = Consumer(open_peer(), Topics(), "odometry", [Topics().color_compressed])
    assert sender.window.wait_for_consumers(1, threading.Event())
    looks: list[float] = []
    monkeypatch.setattr(sender.window, "_take_acknowledgements", lambda subscriber, timeout: looks.append(timeout))
    assert sender.window.wait_for_room(threading.Event())
    assert looks == []
    stop = threading.Event()
    stop.set()
    assert not sender.window.wait_for_room(stop)
    assert consumer.ended is None


def test_a_consumer_that_dies_does_not_hold_the_others(open_peer: OpenSession) -> None:
    messages = session_messages(30)
    sender = Sender(open_peer())
    doomed_session = open_peer()
    Consumer(doomed_session, TOPICS, "recorder", KEYS)
    consumer = Consumer(open_peer(), TOPICS, "odometry", KEYS)
    assert sender.window.wait_for_consumers(2, sender.stop)
    sending = start(sender, messages)
    for _ in range(6):
        assert consumer.receive(30.0) is not None
    time.sleep(0.3)
    assert sender.sent < 20  # held by the recorder, which has acknowledged nothing
    doomed_session.close()
    count = 6
    while consumer.receive(30.0) is not None:
        count += 1
    assert count == len(messages)
    sending.join(30.0)
    assert not sending.is_alive()


def test_without_a_consumer_a_recorded_source_waits_for_one(open_peer: OpenSession) -> None:
    sender = Sender(open_peer())
    sending = start(sender, session_messages(5))
    time.sleep(0.3)
    assert sender.sent == 0
    consumer = Consumer(open_peer(), TOPICS, "odometry", KEYS)
    count = 0
    while consumer.receive(30.0) is not None:
        count += 1
    assert count == 16
    sending.join(30.0)
    assert not sending.is_alive()


@pytest.mark.parametrize("seen", [(TOPICS.camera_info,), ()], ids=["the first", "none"])
@pytest.mark.parametrize("poll_s", [0.1, 20.0])
def test_messages_lost_on_the_way_do_not_stop_the_flow(
    open_peer: OpenSession, monkeypatch: pytest.MonkeyPatch, seen: tuple[str, ...], poll_s: float
) -> None:
    monkeypatch.setattr("odom.wire.send_window._LOST_AFTER_S", 0.8)
    sender = Sender(open_peer())
    consumer = Consumer(open_peer(), TOPICS, "odometry", seen)  # sees neither images nor truth
    sender.window.wait_for_consumers(1, sender.stop)
    sending = start(sender, session_messages(10))
    deadline = time.monotonic() + 60.0
    while consumer.ended is None and time.monotonic() < deadline:
        consumer.receive(poll_s)
    assert consumer.ended == "done"
    sending.join(30.0)
    assert not sending.is_alive()
    assert sender.window.lost > 0


def test_a_consumer_that_is_long_at_a_message_after_having_idled_has_lost_nothing(
    open_peer: OpenSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("odom.wire.send_window._LOST_AFTER_S", 2.0)
    sender = Sender(open_peer())
    consumer = Consumer(open_peer(), TOPICS, "odometry", KEYS)
    sender.window.wait_for_consumers(1, sender.stop)
    calibration, depth, *others = session_messages(5)
    sender.window.listen()
    sender.publisher.put(calibration)
    assert consumer.receive(30.0) is not None
    assert consumer.receive(1.0) is None
    sender.publisher.put(depth)  # before it is known that the consumer idled
    sending = start(sender, others)
    assert consumer.receive(30.0) is not None
    time.sleep(2.5)
    while consumer.receive(30.0) is not None:
        pass
    sending.join(30.0)
    assert (consumer.ended, sender.window.lost) == ("done", 0)


def test_a_malformed_acknowledgement_is_ignored(open_peer: OpenSession) -> None:
    session = open_peer()
    sender = Sender(open_peer())
    consumer = Consumer(session, TOPICS, "odometry", KEYS)
    sender.window.wait_for_consumers(1, sender.stop)
    for garbage in (b"", b"\0\1\0\0", b"\xff" * 100):
        session.zenoh.put(TOPICS.ack_of("odometry"), garbage)
        session.zenoh.put(TOPICS.ack_of("intruder"), garbage)
    sending = start(sender, session_messages(5))
    count = 0
    while consumer.receive(30.0) is not None:
        count += 1
    assert count == 16
    sending.join(30.0)


def test_a_sender_that_never_waits_for_room_remembers_no_more_than_the_window(open_peer: OpenSession) -> None:
    sender = Sender(open_peer())
    for serial in range(1000):
        sender.window.sent(serial, is_frame=True)
    assert len(sender.window._frames) == 4
