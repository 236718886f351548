"""Samples of several keys: in the order of sending, and fetched so that a flood does not hold up the link."""

import random
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import repeat
from types import SimpleNamespace
from typing import cast
from unittest.mock import MagicMock

import numpy as np
import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st
from private_network import OpenSession

from odom.frame import Stamp
from odom.wire import Message, Topics
from odom.wire.bulk_receiver import BulkReceiver, ReceivedSample, in_order
from odom.wire.codec import encode_depth, encode_text
from odom.wire.consumer import Consumer
from odom.wire.delivery import Attachment, encoding_of
from odom.wire.malformed_counter import MalformedCounter
from odom.wire.session import Subscriber, WireSession

_FLOOD = """
import sys, zenoh
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", f'["{sys.argv[1]}"]')
config.insert_json5("scouting/multicast/enabled", "false")
with zenoh.open(config) as session:
    print("flooding", flush=True)
    while True:
        session.put("flooded", b"nonsense")
"""


def arrival(epoch: int | None, serial: int) -> ReceivedSample:
    attachment = None if epoch is None else Attachment(False, epoch, serial, serial, Stamp(0))
    return ReceivedSample("key", attachment, cast(zenoh.Sample, SimpleNamespace(serial=serial)))


@given(st.lists(st.tuples(st.sampled_from([None, 1, 2]), st.integers(0, 1000)), unique=True))
def test_each_senders_samples_come_in_the_order_of_sending_and_the_rest_stays(
    sent: list[tuple[int | None, int]],
) -> None:
    arrivals = [arrival(epoch, serial) for epoch, serial in sent]
    ordered = in_order(arrivals)
    assert sorted(map(id, ordered)) == sorted(map(id, arrivals))
    for epoch in (1, 2):
        serials = [a.attachment.serial for a in ordered if a.attachment and a.attachment.epoch == epoch]
        assert serials == sorted(serials)
    for before, after in zip(arrivals, ordered, strict=True):
        assert (before.attachment and before.attachment.epoch) == (after.attachment and after.attachment.epoch)
        assert before.attachment or before is after


class Channel:
    """A native channel that calls `when_empty` once, when it is looked at and found empty; its bell never rings."""

    def __init__(self) -> None:
        self.samples: list[SimpleNamespace] = []
        self.when_empty: Callable[[], None] = lambda: None

    def try_recv(self) -> SimpleNamespace | None:
        if self.samples:
            return self.samples.pop(0)
        meanwhile, self.when_empty = self.when_empty, lambda: None
        meanwhile()
        return None

    def __iter__(self) -> Iterator[SimpleNamespace]:
        return iter(())


def live_sample(message: Message, serial: int) -> SimpleNamespace:
    attachment = Attachment(False, 7, serial, 0, message.stamp).pack()
    as_bytes = MagicMock(to_bytes=lambda: attachment, __len__=lambda _: len(attachment))
    payload = MagicMock(to_bytes=lambda: message.payload, __len__=lambda _: len(message.payload))
    return SimpleNamespace(
        key_expr=message.topic, attachment=as_bytes, payload=payload, encoding=encoding_of(message.type_name)
    )


def test_the_end_of_a_live_source_does_not_overtake_an_image_that_comes_during_the_look() -> None:
    topics, channels = Topics(), dict[str, Channel]()

    def subscribe(key: str, handler: object) -> SimpleNamespace:
        channel = Channel()
        if isinstance(handler, zenoh.handlers.FifoChannel):
            channels[key] = channel
        return SimpleNamespace(handler=channel, undeclare=lambda: None)

    session = MagicMock(declare_subscriber=subscribe)
    consumer = Consumer(WireSession(session), topics, "odometry", (topics.color, topics.depth))
    depth = live_sample(encode_depth(topics.depth, Stamp(1), np.ones((4, 6), np.uint16)), 0)
    end = live_sample(encode_text(topics.end, Stamp(2), "interrupted"), 1)

    def arrive() -> None:
        channels[topics.depth].samples.append(depth)
        channels[topics.end].samples.append(end)

    channels[topics.depth].when_empty = arrive
    deliveries = []
    while consumer.ended is None:
        deliveries.append(consumer.receive(0.0))
    assert [delivery.message.topic for delivery in deliveries if delivery is not None] == [topics.depth]


def test_a_receiver_that_is_closed_in_a_flood_fetches_nothing_more() -> None:
    """Otherwise the flood keeps a process on a crowded machine from its end."""
    flooded = Channel()
    sample = live_sample(encode_text("key", Stamp(0), "x"), 0)

    def subscribe(key: str, handler: object) -> SimpleNamespace:
        is_bell = isinstance(handler, zenoh.handlers.RingChannel)
        return SimpleNamespace(handler=repeat(sample) if is_bell else flooded, undeclare=lambda: None)

    taken: list[ReceivedSample] = []
    session = cast(zenoh.Session, MagicMock(declare_subscriber=subscribe))
    receiver = BulkReceiver(session, ("key",), MalformedCounter(), taken.extend)
    receiver.close()
    assert "bell of key" not in {thread.name for thread in threading.enumerate()}
    flooded.samples.append(sample)
    assert receiver.fetch() == 0
    assert not taken


def test_messages_of_many_keys_arrive_in_the_order_of_sending(open_peer: OpenSession) -> None:
    sender, receiver = open_peer(), open_peer()
    keys = [f"key{i}" for i in range(8)]
    subscriber = receiver.subscriber(keys, depth=3, lossless=True)
    publisher = sender.publisher(lossless=True)
    for key in keys:
        with sender.zenoh.declare_publisher(key) as probe:
            while not probe.matching_status.matching:
                time.sleep(0.01)
    rng = random.Random(3)
    serials = []
    for _ in range(100):
        for _ in range(rng.randrange(1, 40)):
            publisher.put(encode_text(rng.choice(keys), Stamp(1), ""))
        while len(serials) < publisher.serial:
            delivery = subscriber.receive(30.0)
            assert delivery is not None
            serials.append(delivery.serial)
    assert serials == list(range(publisher.serial))


@contextmanager
def flood(endpoint: str) -> Iterator[None]:
    with subprocess.Popen([sys.executable, "-c", _FLOOD, endpoint], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        yield
        process.kill()


@contextmanager
def busy_interpreter() -> Iterator[None]:
    done = threading.Event()

    def spin() -> None:
        while not done.is_set():
            sum(range(1000))

    thread = threading.Thread(target=spin)
    thread.start()
    yield
    done.set()
    thread.join()


def take_for(subscriber: Subscriber, seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        subscriber.receive(0.05)


@pytest.mark.alone
@pytest.mark.timeout(60)
def test_a_flooded_key_holds_up_nothing_else_while_the_interpreter_is_busy(
    open_peer: OpenSession, endpoint: str
) -> None:
    receiver = open_peer()
    flooded = receiver.subscriber(["flooded"], depth=3)
    with flood(endpoint), busy_interpreter():
        take_for(flooded, 1.0)
        before, begun = flooded.malformed.counts.total(), time.monotonic()
        take_for(flooded, 2.0)
        rate = (flooded.malformed.counts.total() - before) / (time.monotonic() - begun)
    print(f"{rate:.0f} messages a second")
    assert rate > 5000
