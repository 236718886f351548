import resource
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from random import Random
from typing import Literal
from unittest.mock import MagicMock

import psutil
import pytest
import zenoh
from made_up_messages import session_messages
from private_network import OpenSession

from odom.errors import ConfigError, WireError
from odom.frame import Stamp
from odom.wire import Topics, WireSettings
from odom.wire.codec import encode_text
from odom.wire.codec.cdr import POINT_CLOUD
from odom.wire.malformed_counter import MalformedCounter
from odom.wire.session import WireSession, _check_endpoints, open_session, zenoh_config
from odom.wire.settings import ANY_LOCAL_PORT
from odom.wire.subscriber import Subscriber


def eventually(condition: Callable[[], bool], timeout: float = 30.0) -> bool:
    deadline = time.monotonic() + timeout
    while time.monotonic() < deadline:
        if condition():
            return True
        time.sleep(0.01)
    return condition()


def meet(sender: WireSession, key: str) -> None:
    """Wait until a subscriber of `key` is known to the sender."""
    with sender.zenoh.declare_publisher(key) as probe:
        assert eventually(lambda: probe.matching_status.matching)


def text(key: str, number: int) -> object:
    return encode_text(key, Stamp(number), str(number))


def test_messages_arrive_as_they_were_sent_and_counted(open_peer: OpenSession) -> None:
    sender, receiver = open_peer(), open_peer()
    messages = session_messages(5)
    subscriber = receiver.subscriber(["cam0/**", "truth/**"], depth=64)
    meet(sender, "cam0/x")
    meet(sender, "truth/x")
    publisher = sender.publisher()
    serials = [publisher.put(message) for message in messages]
    received = [subscriber.receive(30.0) for _ in messages]
    assert serials == list(range(len(messages)))
    deliveries = [delivery for delivery in received if delivery]
    for key in {message.topic for message in messages}:  # a live sender's messages keep no order between keys
        of_key = [delivery for delivery in deliveries if delivery.message.topic == key]
        assert [delivery.message for delivery in of_key] == [message for message in messages if message.topic == key]
    in_order = sorted(deliveries, key=lambda delivery: delivery.serial)
    assert [(delivery.message, delivery.serial) for delivery in in_order] == list(zip(messages, serials, strict=True))
    assert (in_order[-1].epoch, in_order[-1].sequence) == (publisher.epoch, 4)
    assert subscriber.receive(0.05) is None
    total = subscriber.total()
    assert (total.received, total.lost, total.dropped) == (len(messages), 0, 0)
    assert not subscriber.malformed.counts


def test_a_topic_is_heard_while_someone_takes_it(open_peer: OpenSession) -> None:
    sender, receiver = open_peer(), open_peer()
    publisher = sender.publisher()
    assert not publisher.is_heard("cam0/features", POINT_CLOUD)
    subscriber = receiver.subscriber(["cam0/**"])
    assert eventually(lambda: publisher.is_heard("cam0/features", POINT_CLOUD))
    assert not publisher.is_heard("cam1/features", POINT_CLOUD)
    subscriber.close()
    assert eventually(lambda: not publisher.is_heard("cam0/features", POINT_CLOUD))
    assert sender.publisher(mirror=MagicMock()).is_heard("cam0/features", POINT_CLOUD)


def test_newest_wins_when_the_receiver_is_slow(open_peer: OpenSession) -> None:
    sender, receiver = open_peer(), open_peer()
    subscriber = receiver.subscriber(["a", "b"], depth=3)
    meet(sender, "a")
    meet(sender, "b")
    publisher = sender.publisher()
    for i in range(10):
        publisher.put(encode_text("a", Stamp(i), str(i)))
        publisher.put(encode_text("b", Stamp(i), str(i)))
    assert eventually(lambda: subscriber.total().received == 20)
    waiting = [subscriber.receive(0.0) for _ in range(6)]
    assert [d.sequence for d in waiting if d and d.message.topic == "a"] == [7, 8, 9]
    assert [d.sequence for d in waiting if d and d.message.topic == "b"] == [7, 8, 9]
    assert subscriber.receive(0.0) is None
    assert subscriber.counters["a"].dropped == 7
    assert subscriber.counters["a"].lost == 0


def test_what_strangers_send_too_much_of_is_no_loss_of_the_sensor(open_peer: OpenSession) -> None:
    sender, receiver = open_peer(), open_peer()
    subscriber = receiver.subscriber(["a"], depth=3)
    meet(sender, "a")
    for _ in range(50):
        sender.zenoh.put("a", b"no attachment")
    assert eventually(lambda: subscriber.total().received == 50)
    assert subscriber.waiting <= 3
    assert (subscriber.total().lost, subscriber.total().dropped) == (0, 0)


def test_losses_on_the_way_are_counted_and_a_new_sender_is_none(open_peer: OpenSession) -> None:
    sender, receiver = open_peer(), open_peer()
    subscriber = receiver.subscriber(["a"], depth=64)
    meet(sender, "a")
    publisher = sender.publisher()
    for i in range(2):
        publisher.put(encode_text("a", Stamp(i), ""))
    publisher._sequences["a"] += 4  # as if four had been dropped at a congested link
    publisher.put(encode_text("a", Stamp(1), ""))
    sender.publisher().put(encode_text("a", Stamp(2), ""))
    assert eventually(lambda: subscriber.total().received == 4)
    assert subscriber.counters["a"].lost == 4


def test_malformed_and_foreign_messages_are_survived(open_peer: OpenSession, caplog: pytest.LogCaptureFixture) -> None:
    sender, receiver = open_peer(), open_peer()
    subscriber = receiver.subscriber(["cam0/**"], depth=64)
    meet(sender, "cam0/x")
    info = session_messages(0)[0]
    sender.zenoh.put(info.topic, b"", encoding="application/cdr;sensor_msgs/msg/CameraInfo")
    sender.zenoh.put(info.topic, b"\xff" * 50, attachment=b"\xff" * 33)
    sender.zenoh.put("cam0/unknown", b"\0\1\0\0")
    sender.zenoh.put(Topics().color, info.payload, encoding=f"application/cdr;{info.type_name}")  # of another key
    sender.zenoh.put(info.topic, info.payload)  # a foreign sender: neither encoding nor attachment
    delivery = subscriber.receive(30.0)
    assert delivery is not None
    assert delivery.message == info
    assert delivery.sequence is None
    assert subscriber.malformed.counts.total() == 4
    assert len(caplog.records) == 3


def test_the_death_of_a_process_is_noticed(open_peer: OpenSession, endpoint: str) -> None:
    watcher = open_peer()
    seen: list[tuple[str, bool]] = []
    watcher.watch("cam0/alive/**", lambda key, alive: seen.append((key, alive)))
    with open_session(WireSettings(connect=(endpoint,), listen=())) as session:
        session.announce("cam0/alive")
        session.announce("cam0/alive/odometry")
        assert eventually(lambda: len(seen) == 2)
    assert eventually(lambda: len(seen) == 4)
    assert {key for key, alive in seen if not alive} == {"cam0/alive", "cam0/alive/odometry"}


def test_nothing_listens_beyond_loopback_and_no_memory_is_shared(endpoint: str) -> None:
    before = {c.laddr for c in psutil.Process().net_connections() if c.status == psutil.CONN_LISTEN}
    with open_session(WireSettings(connect=(), listen=(endpoint, "tcp/127.0.0.1:0"))) as session:
        after = {c.laddr for c in psutil.Process().net_connections("inet") if c.status == psutil.CONN_LISTEN} - before
        bound = {c.laddr for c in psutil.Process().net_connections("udp")}
        assert session.zenoh.info.zid()
    assert after
    assert all(address.ip == "127.0.0.1" for address in after)
    assert not bound
    from odom.wire.session import _configuration

    assert _configuration(WireSettings())["transport/shared_memory/enabled"] is False
    assert all("127.0.0.1" in where for where in (*WireSettings().listen, *WireSettings().connect))


def test_a_router_that_is_not_there_is_named_and_what_to_look_for(endpoint: str) -> None:
    settings = WireSettings(mode="client", connect=(endpoint,), zenoh={"connect/timeout_ms": 300})
    with pytest.raises(WireError, match=rf"{endpoint}.*is `odom router --listen` up"), open_session(settings):
        pass


@pytest.mark.parametrize("where", ["tcp/127.0.0.1", "rig:7447", "rig", "tcp/rig:99999", "tcp/rig:", "", "tcp/::1:7447"])
def test_what_is_no_endpoint_is_refused_instead_of_tried_for_ever(where: str) -> None:
    with pytest.raises(ConfigError, match="HOST:PORT"), open_session(WireSettings(connect=(where,), listen=())):
        pass


@pytest.mark.parametrize(("path", "value"), [("transport/lnk/tx", 1), ("transport/link/tx/lease", "long")])
def test_what_zenoh_does_not_take_is_named(path: str, value: int | str) -> None:
    settings = WireSettings(connect=(), listen=(), zenoh={path: value})
    with pytest.raises(ConfigError, match=f"wire.zenoh: '{path}' cannot be set: [a-z ]+$"), open_session(settings):
        pass


@pytest.mark.parametrize("setting", ["connect", "listen"])
def test_an_endpoint_that_zenoh_does_not_take_is_named_with_its_own_setting(setting: str) -> None:
    settings = WireSettings(**{"connect": (), "listen": (), setting: ("udp/rig:1?",)})  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=rf"^wire\.{setting} \(--{setting}\) cannot be set: .*udp/rig:1\?"):
        zenoh_config(settings)


@pytest.mark.parametrize("where", ["tcp/[::1]:7447", "tls/rig.local:7447#iface=eth0", "udp/1.2.3.4:1?rel=0", "vsock/1"])
def test_no_kind_of_endpoint_is_taken_for_none(where: str) -> None:
    _check_endpoints((where,))


@pytest.mark.parametrize("mode", ["peer", "router"])
def test_an_endpoint_that_was_asked_for_and_is_taken_is_an_error(
    endpoint: str, mode: Literal["peer", "router"]
) -> None:
    with open_session(WireSettings(connect=(), listen=(endpoint,))):
        asked = WireSettings(mode=mode, connect=(), listen=(ANY_LOCAL_PORT, endpoint))
        with pytest.raises(WireError, match=f"{endpoint}.*--listen") as refused, open_session(asked):
            pass
    assert ".rs:" not in str(refused.value)


def test_a_meeting_point_that_is_taken_is_left_to_who_holds_it_but_by_no_router(endpoint: str) -> None:
    meeting = WireSettings(connect=(endpoint,), listen=(endpoint, ANY_LOCAL_PORT))
    with open_session(meeting) as first, open_session(meeting) as second:
        meet_each_other: list[str] = []
        first.watch("alive/*", lambda key, alive: meet_each_other.append(key))
        second.announce("alive/second")
        assert eventually(lambda: meet_each_other == ["alive/second"])
        router = meeting.model_copy(update={"mode": "router"})
        with pytest.raises(WireError, match="--listen"), open_session(router):
            pass


@pytest.mark.parametrize("connect", [WireSettings().connect, ("tcp/rig:7447",)])
def test_nobody_asked_for_the_default_endpoints(connect: tuple[str, ...]) -> None:
    settings = WireSettings(connect=connect, listen=(*WireSettings().listen, "tcp/0.0.0.0:7447"))
    assert [where for where in settings.listen if settings.on_purpose(where)] == ["tcp/0.0.0.0:7447"]


def test_closing_wakes_who_waits(open_peer: OpenSession) -> None:
    subscriber = open_peer().subscriber(["a"])
    got: list[object] = []
    waiting = threading.Thread(target=lambda: got.append(subscriber.receive()))
    waiting.start()
    time.sleep(0.05)
    subscriber.close()
    waiting.join(30.0)
    assert got == [None]


def test_a_flood_that_claims_to_be_lossless_is_bounded_in_bytes(open_peer: OpenSession) -> None:
    sender, receiver = open_peer(), open_peer()
    subscriber = receiver.subscriber(["a", "b"], depth=3, lossless=True)
    meet(sender, "a")
    meet(sender, "b")
    publisher = sender.publisher(lossless=True)
    megabyte = encode_text("a", Stamp(0), "x" * 2**20)
    for i in range(200):
        publisher.put(replace(megabyte, topic="ab"[i % 2]))
    assert eventually(lambda: subscriber.total().received == 200)
    assert subscriber.waiting <= 128
    assert subscriber.total().dropped == 200 - subscriber.waiting
    last = [subscriber.receive(0.0) for _ in range(subscriber.waiting)][-1]
    assert last is not None
    assert last.serial == 199


def test_whoever_comes_first_waits_for_the_other_and_meets_it_again(endpoint: str) -> None:
    """A peer whose meeting point is not there yet, or goes away and returns, finds it by itself."""
    seen: list[bool] = []
    with open_session(WireSettings(connect=(endpoint,), listen=())) as early:
        early.watch("hub", lambda key, alive: seen.append(alive))
        for life in range(2):
            time.sleep(0.3)
            with open_session(WireSettings(connect=(), listen=(endpoint,))) as hub:
                hub.announce("hub")
                assert eventually(lambda: len(seen) == 2 * life + 1)  # noqa: B023  # called before the next life
            assert eventually(lambda: len(seen) == 2 * life + 2)  # noqa: B023  # called before the next life
    assert seen == [True, False, True, False]


def test_a_flood_of_nonsense_does_not_crowd_out_a_sender(open_peer: OpenSession) -> None:
    sender, flooder, receiver = open_peer(), open_peer(), open_peer()
    subscriber = receiver.subscriber(["a"], depth=3, lossless=True)
    meet(sender, "a")
    meet(flooder, "a")
    publisher, random = sender.publisher(), Random(1)
    for i in range(3):
        publisher.put(encode_text("a", Stamp(i), str(i)))
    assert eventually(lambda: subscriber.total().received == 3)
    for _ in range(5000):
        flooder.zenoh.put("a", random.randbytes(20), attachment=random.randbytes(random.choice((0, 5, 33))))
    assert eventually(lambda: subscriber.total().received > 1000)
    assert subscriber.waiting <= 3 + 256 + 3
    kept = []
    while (delivery := subscriber.receive(0.2)) is not None:
        kept.append(delivery.message)
    assert [message.payload for message in kept if message.type_name.endswith("String")] == [
        encode_text("a", Stamp(i), str(i)).payload for i in range(3)
    ]


def test_invented_keys_lock_out_no_key_that_was_asked_for(open_peer: OpenSession) -> None:
    sender, flooder, receiver = open_peer(), open_peer(), open_peer()
    subscriber = receiver.subscriber(["truth/*/pose", "cam0/odom"], depth=1)
    meet(sender, "cam0/odom")
    meet(flooder, "truth/x/pose")
    for i in range(1000):
        flooder.zenoh.put(f"truth/{i}/pose", b"invented", congestion_control=zenoh.CongestionControl.BLOCK)
    assert eventually(lambda: subscriber.total().received >= 256)
    time.sleep(0.3)
    sender.publisher().put(encode_text("cam0/odom", Stamp(1), "real"))
    assert eventually(lambda: subscriber.counters["cam0/odom"].received == 1)
    assert len(subscriber.counters) <= 257
    assert subscriber.waiting <= 257


def test_a_flooded_key_is_not_looked_at_but_its_sender_and_other_keys_are(open_peer: OpenSession) -> None:
    sender, flooder, receiver = open_peer(), open_peer(), open_peer()
    subscriber = receiver.subscriber(["a", "b"], depth=64)
    for session, key in ((sender, "a"), (flooder, "a"), (flooder, "b")):
        meet(session, key)
    for _ in range(40):
        flooder.zenoh.put("a", b"nonsense")
    assert eventually(lambda: subscriber.total().received == 40)
    for _ in range(32):
        subscriber.malformed.add("a", "nonsense")  # as its reader finds
    publisher = sender.publisher()
    flooder.zenoh.put("a", b"more nonsense")
    flooder.zenoh.put("b", b"of a foreign sender")
    for i in range(3):
        publisher.put(encode_text("a", Stamp(i), str(i)))
    assert eventually(lambda: subscriber.total().received == 44)
    assert subscriber.malformed.counts["a"] == 33
    assert subscriber.counters["b"].received == 1


def test_a_key_is_flooded_for_a_second_and_no_longer() -> None:
    now = 0.0
    malformed = MalformedCounter(lambda: now)
    for _ in range(31):
        malformed.add("a", "why")
    now = 0.9
    assert "a" not in malformed.flooded()
    malformed.add("a", "why")
    now = 1.8
    assert malformed.flooded() == {"a"}
    malformed.ignore(Counter({"a": 1}))
    now = 1.9
    assert "a" not in malformed.flooded()
    for _ in range(3):
        now += 0.03  # a foreign sender of 30 Hz with something else is never a flood
        malformed.add("a", "why")
        assert "a" not in malformed.flooded()
    assert malformed.counts == {"a": 36}


def test_receiving_a_message_maps_no_memory(open_peer: OpenSession) -> None:
    """Pages mapped for each message would take longer than the message, and halt the other cores meanwhile.

    Now and then messages that wait take pages, too: the least of several tries counts.
    """
    sender, receiver = open_peer(), open_peer()
    subscriber = receiver.subscriber(["a"], depth=3)
    meet(sender, "a")

    def receive(count: int) -> int:
        before, faults = subscriber.total().received, resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        for _ in range(count):
            sender.zenoh.put("a", b"small", congestion_control=zenoh.CongestionControl.BLOCK)
        assert eventually(lambda: subscriber.total().received == before + count)
        return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - faults

    receive(1000)
    assert min(receive(5000) for _ in range(4)) < 2500


def test_all_processes_of_the_same_meeting_point_hear_each_other(endpoint: str) -> None:
    settings = WireSettings(connect=(endpoint,), listen=(endpoint,))
    with ExitStack() as stack:
        first, second, third = (stack.enter_context(open_session(settings)) for _ in range(3))
        subscribers = [session.subscriber(["a"]) for session in (first, second)]
        publisher = third.publisher()
        assert eventually(lambda: len(third.zenoh.info.peers_zid()) == 2, timeout=5.0)

        def hears(subscriber: Subscriber) -> bool:
            publisher.put(encode_text("a", Stamp(1), "1"))
            return subscriber.receive(0.5) is not None

        assert all(eventually(partial(hears, one), timeout=10.0) for one in subscribers)
