"""Samples of several keys: in the order of sending, and fetched so that a flood does not hold up the link."""

import random
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import cast

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st
from private_network import OpenSession

from odom.frame import Stamp
from odom.wire.codec import encode_text
from odom.wire.delivery import Attachment
from odom.wire.inlet import Arrival, in_order
from odom.wire.session import Subscriber

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


def arrival(epoch: int | None, serial: int) -> Arrival:
    attachment = None if epoch is None else Attachment(False, epoch, serial, serial, Stamp(0))
    return Arrival("key", attachment, cast(zenoh.Sample, SimpleNamespace(serial=serial)))


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
            delivery = subscriber.receive(5.0)
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
