"""`odom serve` against whatever may arrive on its keys: it counts, drops and goes on."""

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import psutil
import pytest
import zenoh
from numpy.typing import NDArray

from odom.frame import Camera, Stamp
from odom.service.local_run import free_endpoint
from odom.wire import Message, Topics, WireSettings, codec
from odom.wire.session import Publisher, WireSession, open_session

Start = Callable[..., Any]
Eventually = Callable[..., None]

TOPICS = Topics("cam0")
CAMERA = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
PERIOD_NS = 33_333_333
START = Stamp(1_700_000_000_000_000_000)


class Served:
    """A running `odom serve`, its words, its status and a session beside it."""

    def __init__(self, process: Any, session: WireSession, out: Path) -> None:
        self.process, self.session, self.out = process, session, out
        self.words: list[str] = []
        self.status: dict[str, str] = {}
        self.publisher: Publisher = session.publisher(lossless=True)
        self._subscriber = session.subscriber((TOPICS.status,), depth=1)
        threading.Thread(target=self._read, daemon=True).start()
        threading.Thread(target=self._watch, daemon=True).start()

    def _read(self) -> None:
        for line in self.process.stdout:
            self.words.append(line)

    def _watch(self) -> None:
        while (delivery := self._subscriber.receive()) is not None:
            self.status = dict(codec.decode_status(delivery.message)[0].values)

    def count(self, name: str) -> int:
        return int(float(self.status.get(name, 0)))

    def poses(self) -> int:
        path = self.out / "odometry.txt"
        return len(path.read_text().splitlines()) if path.exists() else 0


@pytest.fixture
def served(odom: Start, eventually: Eventually, tmp_path: Path) -> Iterator[Served]:
    endpoint = free_endpoint()
    with open_session(WireSettings(connect=(), listen=(endpoint,))) as session:
        process = odom("serve", "--out", tmp_path / "out", "--connect", endpoint, "--listen", "tcp/127.0.0.1:0")
        running = Served(process, session, tmp_path / "out")
        here = threading.Event()
        session.watch(TOPICS.alive_of("odometry"), lambda key, alive: here.set() if alive else None)
        assert here.wait(60), running.words
        yield running
        process.terminate()
        assert process.wait(60) == 0, running.words
        assert not any("Traceback" in line for line in running.words), running.words


@cache
def wall() -> NDArray[np.uint8]:
    texture = np.random.default_rng(1).integers(0, 256, (60, 160, 3), dtype=np.uint8)
    return np.asarray(cv2.resize(texture, (1600, 500), interpolation=cv2.INTER_CUBIC), dtype=np.uint8)


def scene(i: int) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
    """A wall with texture, the camera moving sideways by 4 pixels a frame."""
    color = np.ascontiguousarray(wall()[:480, 4 * i : 4 * i + 640])
    return color, np.full((480, 640), 2000, dtype=np.uint16)


def send(publisher: Publisher, i: int, stamp: Stamp | None = None) -> None:
    at = Stamp(START + i * PERIOD_NS) if stamp is None else stamp
    color, depth = scene(i)
    publisher.put(codec.encode_color_jpeg(TOPICS.color_compressed, at, color))
    publisher.put(codec.encode_depth(TOPICS.depth, at, depth))


def stream(served: Served, indices: range, offset_ns: int = 0) -> None:
    served.publisher.put(codec.encode_camera_info(TOPICS.camera_info, START, CAMERA))
    for i in indices:
        send(served.publisher, i, Stamp(START + i * PERIOD_NS + offset_ns))
        time.sleep(PERIOD_NS * 1e-9)


def calibrate(served: Served, camera: Camera) -> None:
    served.publisher.put(codec.encode_camera_info(TOPICS.camera_info, START, camera))


def malformed() -> Iterator[Message]:
    """Every kind of nonsense on every key."""
    color, depth = scene(0)
    rng = np.random.default_rng(7)
    good = {
        TOPICS.color: codec.encode_color(TOPICS.color, START, color),
        TOPICS.color_compressed: codec.encode_color_jpeg(TOPICS.color_compressed, START, color),
        TOPICS.depth: codec.encode_depth(TOPICS.depth, START, depth),
        TOPICS.depth_compressed: codec.encode_depth_compressed(TOPICS.depth_compressed, START, depth, codec="rvl"),
        TOPICS.camera_info: codec.encode_camera_info(TOPICS.camera_info, START, CAMERA),
        "truth/body/pose": codec.encode_pose("truth/body/pose", START, np.eye(4), "world"),
        TOPICS.end: codec.encode_text(TOPICS.end, START, "end"),
    }
    for topic, message in good.items():
        payload = message.payload
        for wrong in (b"", b"\0", b"\0\1\0\0", payload[: len(payload) // 2], rng.bytes(200), payload[4:]):
            yield Message(topic, message.type_name, START, wrong)
    info = bytearray(good[TOPICS.camera_info].payload)
    nan = np.float64("nan").tobytes()
    at = bytes(info).find(np.float64(CAMERA.fx).tobytes())
    info[at : at + 8] = nan
    yield Message(TOPICS.camera_info, good[TOPICS.camera_info].type_name, START, bytes(info))
    unknown = good[TOPICS.color].payload.replace(b"rgb8", b"xyz8")
    yield Message(TOPICS.color, good[TOPICS.color].type_name, START, unknown)
    yield codec.encode_color(TOPICS.color, Stamp(START - 5), np.zeros((1, 1, 3), dtype=np.uint8))
    yield codec.encode_depth(TOPICS.depth, Stamp(START - 5), np.zeros((240, 320), dtype=np.uint16))


def test_malformed_messages_are_counted_and_tracking_goes_on(served: Served, eventually: Eventually) -> None:
    sent = 0
    for message in malformed():
        served.publisher.put(message)
        sent += 1
        time.sleep(0.005)
    eventually(lambda: served.count("dropped") >= 0.8 * sent, 60, f"{sent} malformed counted, {served.status}")
    stream(served, range(20))
    eventually(lambda: served.poses() >= 18, 60, f"poses {served.status}")
    warned = [line for line in served.words if "WARNING" in line]
    assert len(warned) <= 16, "one line a kind"


def test_truth_of_bodies_with_impossible_names_or_too_many_is_counted_and_ends_nothing(
    served: Served, eventually: Eventually
) -> None:
    names = ["Küche", "a" * 250, "the rig", "..", "camera"]
    for name in names:
        topic = f"truth/{name}/pose"
        served.publisher.put(replace(codec.encode_pose("truth/body/pose", START, np.eye(4), "world"), topic=topic))
    stream(served, range(20))
    eventually(lambda: served.poses() >= 18, 60, f"poses {served.status}")
    eventually(lambda: served.count("dropped") == len(names) - 1, 60, f"bodies counted {served.status}")
    assert (served.out / "truth.txt").read_text().splitlines()[0] == "# body camera"
    assert not list(served.out.glob("truth_*"))

    before = served.count("dropped")
    for i in range(100):
        served.publisher.put(codec.encode_pose(f"truth/body{i}/pose", START, np.eye(4), "world"))
        time.sleep(0.005)
    eventually(lambda: served.count("dropped") == before + 100 - 15, 60, f"a flood of bodies counted {served.status}")
    assert len(list(served.out.glob("truth*.txt"))) == 16


def test_stamps_that_repeat_go_back_or_leap_are_counted_and_survived(served: Served, eventually: Eventually) -> None:
    stream(served, range(10))
    send(served.publisher, 9)
    send(served.publisher, 4)
    stream(served, range(10, 20))
    eventually(lambda: served.poses() >= 19, 60, "poses before the leap")
    hour = 3600 * 1_000_000_000
    stream(served, range(20, 35), hour)
    eventually(lambda: served.count("frames") >= 30, 60, f"frames behind the leap {served.status}")
    eventually(lambda: served.count("dropped") >= 4, 60, f"what was dropped is counted {served.status}")


def test_a_full_disk_holds_no_pose_back(served: Served, eventually: Eventually) -> None:
    odometry = psutil.Process(served.process.pid)
    stream(served, range(10))
    eventually(lambda: served.poses() >= 9, 60, "poses")
    full = (served.out / "odometry.txt").stat().st_size + 20
    before = odometry.rlimit(psutil.RLIMIT_FSIZE)
    odometry.rlimit(psutil.RLIMIT_FSIZE, (full, before[1]))
    poses = served.session.subscriber((TOPICS.odom,), depth=64)
    stream(served, range(10, 25))
    eventually(lambda: served.count("unwritten") >= 12, 60, f"what was not written is counted {served.status}")
    eventually(lambda: poses.waiting >= 14, 60, "poses are published all the same")
    assert sum("cannot be written" in line for line in served.words) == 1
    odometry.rlimit(psutil.RLIMIT_FSIZE, before)
    stream(served, range(25, 35))
    eventually(lambda: served.poses() >= 18, 60, "poses are written again")
    assert {len(line.split()) for line in (served.out / "odometry.txt").read_text().splitlines()} == {8}


def test_a_calibration_that_cannot_be_used_gives_way_to_one_that_can_and_that_one_to_no_other(
    served: Served, eventually: Eventually
) -> None:
    prism = replace(CAMERA, distortion=(0.0,) * 8 + (0.01,) * 4)
    calibrate(served, prism)
    for i in range(5):
        send(served.publisher, i)
        time.sleep(0.05)
    calibrate(served, prism)
    eventually(lambda: served.count("dropped") >= 5, 60, f"frames without calibration counted {served.status}")
    stream(served, range(5, 25))
    eventually(lambda: served.poses() >= 18, 60, f"poses {served.status}")
    assert sum("first 8 coefficients" in line for line in served.words) == 1

    eventually(lambda: served.count("frames") >= 20, 60, f"frames counted {served.status}")
    before, poses = served.count("dropped"), served.poses()
    calibrate(served, replace(CAMERA, fx=500.0))
    eventually(lambda: "restart to use it" in served.status.get("conflict", ""), 60, f"told {served.status}")
    stream(served, range(25, 35))
    eventually(lambda: served.poses() >= poses + 9, 60, f"poses after another calibration {served.status}")
    eventually(lambda: served.count("dropped") == before + 1, 60, f"the other calibration counted {served.status}")
    eventually(lambda: "conflict" not in served.status, 60, f"the first calibration came again {served.status}")


def test_a_calibration_of_another_image_is_not_held_on_to(served: Served, eventually: Eventually) -> None:
    calibrate(served, Camera(4096, 4096, 3000.0, 3000.0, 2047.5, 2047.5))
    send(served.publisher, 0)
    eventually(lambda: served.count("dropped") >= 1, 60, f"a frame of another size counted {served.status}")
    assert served.count("rss_mb") < 600
    stream(served, range(1, 25))
    eventually(lambda: served.poses() >= 20, 60, f"poses {served.status}")


def test_a_stream_that_stops_is_followed_again_and_two_that_do_one_job_are_told(
    served: Served, eventually: Eventually
) -> None:
    """Poses, or images, of two that do one job would alternate: log and status say so after a while."""
    stream(served, range(15))
    assert "conflict" not in served.status
    for role, name in (("odometry", "desk-77"), ("sensor", "rig-1"), ("sensor", "spare-2")):
        served.session.announce(f"{TOPICS.alive_of(role)}/{name}")
    eventually(lambda: served.status.get("state") == "WAITING", 5, "the silence is told")
    assert "no frame for" in served.status["reason"]
    stream(served, range(15, 30), 2_000_000_000)
    eventually(lambda: served.count("frames") >= 27, 60, "frames after the silence")

    eventually(lambda: served.status.get("conflict", "").count("--namespace") == 2, 20, "both conflicts in the status")
    told = [line for line in served.words if "alternate" in line]
    assert len(told) == 2
    assert any(all(word in line for word in ("2 odometry processes", "desk-77", "poses")) for line in told)
    assert any(all(word in line for word in ("2 sensors", "rig-1", "spare-2", "images")) for line in told)


def history(served: Served) -> dict[str, tuple[codec.StampedPose, ...]]:
    """What those who join late are told of the way, by key."""
    replies = served.session.zenoh.get("cam0/history", accept_replies=zenoh.ReplyKeyExpr.ANY, timeout=5.0)
    samples = [reply.ok for reply in replies if reply.ok is not None]
    messages = [
        Message(str(s.key_expr), str(s.encoding).partition(";")[2], START, s.payload.to_bytes()) for s in samples
    ]
    return {message.topic: codec.decode_path(message) for message in messages}


def test_those_who_join_late_are_told_the_way_so_far_or_the_new_one_after_the_time_went_back(
    served: Served, eventually: Eventually
) -> None:
    served.publisher.put(codec.encode_pose("truth/body/pose", START, np.eye(4), "world"))
    stream(served, range(15))
    eventually(lambda: served.poses() >= 13, 60, "poses")
    told = history(served)
    assert told.keys() >= {"cam0/history/odom", "truth/body/history"}
    assert len(told["cam0/history/odom"]) >= 13

    minute = 60 * 1_000_000_000
    stream(served, range(15, 35), -minute)
    eventually(lambda: served.count("frames") >= 25, 60, f"frames of both {served.status}")
    way = history(served)["cam0/history/odom"]
    assert len(way) >= 8
    assert way[-1].stamp < START
    assert way[0].stamp < START


def test_a_question_by_a_wildcard_is_answered_and_one_that_refuses_the_answers_is_told_why(
    served: Served, eventually: Eventually
) -> None:
    stream(served, range(15))
    eventually(lambda: served.poses() >= 13, 60, "poses")
    ask = partial(served.session.zenoh.get, timeout=5.0, consolidation=zenoh.ConsolidationMode.NONE)
    replies = [reply.ok for reply in ask("cam0/**", accept_replies=zenoh.ReplyKeyExpr.ANY)]
    assert {"cam0/history/odom", TOPICS.path, TOPICS.keyframes} <= {str(ok.key_expr) for ok in replies if ok}
    (refused,) = ask("cam0/history", payload=b"\xff")
    assert refused.err is not None
    assert "must accept replies on any key" in refused.err.payload.to_string()
    assert not any("Traceback" in line for line in served.words)


def test_each_key_frame_has_a_cloud_of_its_own_colours_for_those_who_join_late(
    served: Served, eventually: Eventually
) -> None:
    """Ahead of the images are some that cannot be decoded: their colours are not taken for those of a frame."""
    for i in range(-9, 0, 3):
        image = codec.encode_color_jpeg(TOPICS.color_compressed, Stamp(START + i * PERIOD_NS), scene(0)[0])
        served.publisher.put(replace(image, payload=image.payload[: len(image.payload) // 2]))
    stream(served, range(120))
    eventually(lambda: served.poses() >= 110, 60, "poses")
    replies = list(served.session.zenoh.get(TOPICS.keyframes, timeout=5.0, consolidation=zenoh.ConsolidationMode.NONE))
    payloads = [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]
    clouds = [Message(TOPICS.keyframes, "sensor_msgs/msg/PointCloud2", START, payload) for payload in payloads]
    (path,) = [reply.ok for reply in served.session.zenoh.get(TOPICS.path, timeout=5.0)]
    assert path is not None
    keyframes = codec.decode_path(Message(TOPICS.path, "nav_msgs/msg/Path", START, path.payload.to_bytes()))
    stamps = [codec.stamp_of(cloud.type_name, cloud.payload) for cloud in clouds]
    assert len(keyframes) > 1
    assert stamps[: len(keyframes)] == [keyframe.stamp for keyframe in keyframes]
    for stamp, cloud in zip(stamps, clouds, strict=True):
        assert stamp is not None
        points, colors = codec.decode_cloud(cloud)
        color, _ = scene(round((stamp - START) / PERIOD_NS))
        u = np.rint(points[:, 0] / points[:, 2] * CAMERA.fx + CAMERA.cx).astype(int)
        v = np.rint(points[:, 1] / points[:, 2] * CAMERA.fy + CAMERA.cy).astype(int)
        small = cv2.resize(color, (160, 120), interpolation=cv2.INTER_AREA)
        assert np.abs(colors.astype(int) - small[v // 4, u // 4]).mean() < 8
