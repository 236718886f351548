"""OptiTrack: the NatNet client against a server, over real sockets; Motive files."""

import logging
import math
import random
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from closing import closed_after
from hypothesis import given
from hypothesis import strategies as st
from natnet_server import NatNetServer, Pose
from scipy.spatial.transform import Rotation

from odom.errors import ConfigError, SourceError, WireError
from odom.wire import Message, truth
from odom.wire.codec import decode_pose
from sensors.optitrack import open_optitrack, packets
from sensors.optitrack.names import names_of
from sensors.optitrack.source import OptiTrackSource
from sensors.source import SourceOptions


def swing(host_s: float) -> Pose:
    """A position that tells its time: 0.5 m to and fro at 1 Hz, so 1 ms of error is 3 mm at the middle."""
    angle = 2 * math.pi * math.fmod(host_s, 1.0)
    q = Rotation.from_rotvec([0.1, 0.4, -0.2]).as_quat()
    return (0.5 * math.sin(angle), 1.2, 0.5 * math.cos(angle)), tuple(q)


def connect(server: NatNetServer, seconds: float | None = None, **extra: str) -> OptiTrackSource:
    settings = {"command_port": str(server.command_port), "local": server.address} | extra
    source = open_optitrack(
        f"optitrack:{server.address}", SourceOptions(seconds=seconds, extra=tuple(settings.items()))
    )
    assert isinstance(source, OptiTrackSource)
    return source


def time_error_ms(message: Message) -> float:
    """How far the stamp is from the time that the position tells."""
    x, _, z = decode_pose(message).T_parent_child[:3, 3] * np.array([1, 1, -1])
    z = -decode_pose(message).T_parent_child[1, 3]
    told = math.atan2(x, z) / (2 * math.pi) % 1.0
    error = (message.stamp * 1e-9 - told) % 1.0
    return 1e3 * (error - 1.0 if error > 0.5 else error)


@pytest.mark.parametrize("version", [(3, 0), (4, 0), (4, 1)], ids=["3.0", "4.0", "4.1"])
@pytest.mark.parametrize("multicast", [None, "239.255.42.99"], ids=["unicast", "multicast"])
def test_poses_carry_the_capture_time_in_the_hosts_clock(version: tuple[int, int], multicast: str | None) -> None:
    with NatNetServer({"camera rig": swing}, version=version, multicast=multicast, drift_ppm=150.0) as server:
        source = connect(server, seconds=2.0)
        messages = list(source.messages())
        source.close()
    assert len(messages) > 200
    assert {message.topic for message in messages} == {"truth/camera_rig/pose"}
    errors = [time_error_ms(message) for message in messages[20:]]
    assert abs(np.median(errors)) < 0.5
    assert np.percentile(np.abs(errors), 95) < 1.0
    assert source.client.counters["malformed"] == 0


def test_y_up_becomes_z_up() -> None:
    with NatNetServer({"rig": swing}) as server:
        source = connect(server)
        T = decode_pose(next(source.messages())).T_parent_child
        source.close()
    assert T[2, 3] == pytest.approx(1.2)
    up_in_body = Rotation.from_rotvec([0.1, 0.4, -0.2]).as_matrix().T @ [0, 1, 0]
    assert pytest.approx(up_in_body, abs=1e-6) == T[:3, :3].T @ [0, 0, 1]


def test_untracked_bodies_are_counted_not_published_and_one_may_be_chosen() -> None:
    bodies = {"rig": swing, "hidden": lambda _: None, "wand": swing}
    with NatNetServer(bodies) as server:
        source = connect(server, seconds=0.5)
        topics = {message.topic for message in source.messages()}
        assert topics == {"truth/rig/pose", "truth/wand/pose"}
        assert source.client.counters["untracked"] > 10
        source.close()
        source = connect(server, seconds=0.3, body="wand")
        assert {message.topic for message in source.messages()} == {"truth/wand/pose"}
        source.close()


def test_a_server_that_was_silent_is_heard_again() -> None:
    with NatNetServer({"rig": swing}) as server:
        source = connect(server)
        stream = source.messages()
        next(stream)
        server.silent = True
        threading.Timer(2.5, lambda: setattr(server, "silent", False)).start()
        back = time.time_ns() + 2_400_000_000
        message = next(m for m in stream if m.stamp > back)
        assert abs(time_error_ms(message)) < 2.0
        source.close()


def test_seconds_end_a_take_though_the_server_is_silent() -> None:
    with NatNetServer({"rig": swing}) as server:
        source = connect(server, seconds=1.0)
        stream = source.messages()
        next(stream)
        begun = time.monotonic()
        server.silent = True
        with closed_after(4.0, source):
            list(stream)
            assert 0.5 < time.monotonic() - begun < 2.0


def test_a_server_that_turns_from_unicast_to_multicast_is_heard_again() -> None:
    with NatNetServer({"rig": swing}) as server:
        source = connect(server)
        stream = source.messages()
        next(stream)
    moved = NatNetServer({"rig": swing}, command_port=server.command_port, multicast="239.255.42.98")
    with closed_after(8.0, source), moved:
        turned = time.time_ns()
        assert any(message.stamp > turned for message in stream)


def test_bodies_that_would_share_a_key_are_told_apart_by_their_number(caplog: pytest.LogCaptureFixture) -> None:
    bodies = {"Kopf ä": swing, "Kopf ö": swing, "rig": swing, "long" * 20 + "1": swing, "long" * 20 + "2": swing}
    with NatNetServer(bodies) as server:
        source = connect(server, seconds=0.5)
        topics = {message.topic for message in source.messages()}
        source.close()
        assert {"truth/Kopf___1/pose", "truth/Kopf___2/pose", "truth/rig/pose"} < topics
        assert len(topics) == len(bodies)
        assert caplog.text.count("Kopf ä_1") == 1
        source = connect(server, seconds=0.3, body="Kopf ö")
        assert {message.topic for message in source.messages()} == {"truth/Kopf__/pose"}
        source.close()


def test_a_name_that_another_ones_number_makes_is_told_apart_too() -> None:
    said = {1: "Kopf ä", 2: "Kopf ö", 3: "Kopf ä_1"}
    names, fault = names_of(said, body="")
    assert len({truth(name) for name in names.values()}) == len(said)
    assert all(name in fault for name in names.values())


def test_a_group_that_cannot_be_heard_leaves_no_socket_open() -> None:
    with NatNetServer({"rig": swing}) as server:
        source = connect(server)
        held = len(source.client._sockets)
        with pytest.raises(OSError, match="assign"):
            source.client._join(replace(source.client.server, multicast="203.0.113.1"))
        assert len(source.client._sockets) == held
        source.close()


def test_a_body_is_missed_by_a_server_without_any() -> None:
    assert names_of({}, body="rig")[1] == "no rigid body is called 'rig': there are none"


def test_a_body_that_is_not_there_is_told_with_those_that_are(caplog: pytest.LogCaptureFixture) -> None:
    with NatNetServer({"rig": swing, "wand": swing}) as server:
        source = connect(server, body="wnad")
        threading.Timer(0.6, source.close).start()
        assert list(source.messages()) == []
    assert [r.getMessage() for r in caplog.records if "wnad" in r.getMessage()] == [
        "no rigid body is called 'wnad': there are rig, wand"
    ]


def test_descriptions_of_bodies_that_are_not_described_are_asked_for_once_a_second() -> None:
    asked: list[float] = []

    class Reticent(NatNetServer):
        def _models(self) -> bytes:
            asked.append(time.monotonic())
            return bytes(4)

    with Reticent({"rig": swing}) as server:
        source = connect(server)
        threading.Timer(1.5, source.close).start()
        assert list(source.messages()) == []
    assert 2 <= len(asked) <= 5


def test_poses_of_a_server_that_was_started_anew_carry_no_time_of_its_earlier_clock() -> None:
    with NatNetServer({"rig": swing}) as server:
        source = connect(server)
        stream = source.messages()
        next(stream)
    down = time.time_ns()
    threading.Timer(4.0, source.close).start()
    time.sleep(2.2)
    with NatNetServer({"rig": swing}, command_port=server.command_port, origin_s=time.time() - 30.0):
        stamps = [message.stamp for message in stream]
    after = [stamp for stamp in stamps if not down - 1e9 < stamp < down]
    assert len(after) > 50
    assert min(after) > down + 2e9


def test_poses_of_a_take_that_is_played_back_have_the_time_of_sending_and_none_without_any() -> None:
    with NatNetServer({"rig": swing}, times_known=(False, False, True)) as server:
        source = connect(server, seconds=0.5)
        errors = [time_error_ms(message) for message in source.messages()]
        source.close()
    assert len(errors) > 30
    assert np.median(errors) == pytest.approx(1e3 * server.latency_s, abs=2.0)
    with NatNetServer({"rig": swing}, times_known=(False, False, False)) as server:
        source = connect(server)
        threading.Timer(1.0, source.close).start()
        assert list(source.messages()) == []
        assert source.client.counters["undated"] > 30


def test_malformed_datagrams_are_counted_told_and_harmless(caplog: pytest.LogCaptureFixture) -> None:
    rng = random.Random(3)

    def garble(datagram: bytes) -> bytes:
        kind = rng.random()
        if datagram[0] != 7 or kind < 0.4:
            return datagram
        if kind < 0.7:
            return datagram[: rng.randrange(len(datagram))]
        spoilt = bytearray(datagram)
        for _ in range(4):
            spoilt[rng.randrange(4, len(spoilt))] = rng.randrange(256)
        return bytes(spoilt)

    with NatNetServer({"rig": swing}, garble=garble) as server, caplog.at_level(logging.INFO):
        source = connect(server, seconds=2.0)
        messages = list(source.messages())
        source.close()
        source.close()
    told = [record.getMessage() for record in caplog.records if "malformed" in record.getMessage()]
    assert told == [
        f"OptiTrack Virtual Motive: {', '.join(f'{n} {what}' for what, n in source.client.counters.items())}"
    ]
    assert source.client.counters["malformed"] > 10
    assert len(messages) > 60
    assert all(np.isfinite(decode_pose(message).T_parent_child).all() for message in messages)


@given(st.binary(max_size=400), st.sampled_from([(3, 0), (4, 0), (4, 1), (4, 2)]))
def test_any_bytes_are_refused_politely(payload: bytes, version: tuple[int, int]) -> None:
    for read in (
        packets.split,
        packets.read_echo,
        packets.read_server_info,
        lambda data: packets.read_models(data, version),
        lambda data: packets.read_frame(data, version),
    ):
        try:
            read(payload)
        except WireError:
            continue


def test_frames_agree_with_an_independent_reader() -> None:
    """PyPI's natnet reads the test server's frames as this project's client does."""
    natnet = pytest.importorskip("natnet")
    from natnet.packet_buffer import PacketBuffer

    for version in [(3, 0), (4, 0), (4, 1)]:
        payload = NatNetServer({"rig": swing, "wand": swing}, version=version)._frame(7, 1.7e9 + 0.3)
        ours = packets.read_frame(payload, version)
        theirs = natnet.DataFrame.read_from_buffer(PacketBuffer(payload), natnet.Version(*version))
        assert ours.number == theirs.prefix.frame_number
        assert ours.exposed == theirs.suffix.stamp_camera_mid_exposure
        for mine, other in zip(ours.bodies, theirs.rigid_bodies, strict=True):
            assert (mine.identifier, mine.position, mine.quaternion) == (other.id_num, other.pos, other.rot)
            assert mine.valid == other.tracking_valid


@pytest.mark.process
def test_no_server_says_what_to_switch_on() -> None:
    with pytest.raises(SourceError, match="Broadcast Frame Data"):
        open_optitrack("optitrack:127.0.0.1", SourceOptions(extra=(("timeout_s", "0.5"), ("command_port", "9"))))


def test_an_old_server_is_refused_with_the_reason() -> None:
    with NatNetServer({"rig": swing}, version=(2, 9)) as server, pytest.raises(SourceError, match=r"2\.9.*Motive 2\.0"):
        connect(server, timeout_s="0.7")


def test_an_unknown_option_is_named() -> None:
    with pytest.raises(ConfigError, match="colour"):
        open_optitrack("optitrack:127.0.0.1", SourceOptions(extra=(("colour", "red"),)))


def motive_rows() -> Iterator[str]:
    yield "Format Version,1.23,Take Name,walk,Rotation Type,Quaternion,Length Units,Millimeters"
    yield ""
    yield ",Type," + ",".join(["Rigid Body"] * 7)
    yield ",Name," + ",".join(["rig"] * 7)
    yield ",ID," + ",".join(["1"] * 7)
    yield ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position"
    yield "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z"
    for index in range(12):
        yield f"{index},{index / 120:.6f},0,0,0,1,{index},1200,-500"


def test_a_motive_file_is_a_source(tmp_path: Path) -> None:
    file = tmp_path / "walk.csv"
    file.write_text("\n".join(motive_rows()) + "\n")
    source = open_optitrack(str(file), SourceOptions(extra=(("start_s", "1700000000"), ("body", "rig"))))
    messages = list(source.messages())
    assert [message.topic for message in messages] == ["truth/rig/pose"] * 12
    assert messages[3].stamp == 1_700_000_000_025_000_000
    assert decode_pose(messages[3]).T_parent_child[:3, 3] == pytest.approx([0.003, 0.5, 1.2])
