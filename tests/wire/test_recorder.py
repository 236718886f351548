import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from made_up_messages import BEGIN, session_messages
from private_network import OpenSession

from odom.frame import Stamp
from odom.wire import Message, Topics, truth
from odom.wire.codec import Status, encode_pose, encode_status, encode_text
from odom.wire.recorder import Recorder, RecorderReport, Timeline
from odom.wire.recording import RecordingReader, RecordingWriter
from odom.wire.session import Delivery, WireSession

TOPICS = Topics()
IMAGES = (TOPICS.color_compressed, TOPICS.depth, TOPICS.camera_info)


@contextmanager
def recording(session: WireSession, sender: WireSession, file: Path) -> Iterator["Recording"]:
    """A recorder at work that the sender has met; at the end it is stopped."""
    with RecordingWriter(file) as writer:
        running = Recording(Recorder(session, TOPICS, writer))
        for key in (TOPICS.depth, TOPICS.status, TOPICS.pose, truth("camera")):
            with sender.zenoh.declare_publisher(key) as probe:
                while not probe.matching_status.matching:
                    time.sleep(0.01)
        yield running
        running.stop.set()
        running.thread.join(30.0)


class Recording:
    def __init__(self, recorder: Recorder) -> None:
        self.stop = threading.Event()
        self.taken = 0
        self.waiting = lambda: recorder._consumer._subscriber.waiting
        self._receive = recorder._consumer.receive
        recorder._consumer.receive = self._count  # type: ignore[method-assign]
        self.reports: list[RecorderReport] = []
        self.thread = threading.Thread(target=lambda: self.reports.append(recorder.run(self.stop)), daemon=True)
        self.thread.start()

    def _count(self, timeout: float) -> Delivery | None:
        delivery = self._receive(timeout)
        self.taken += delivery is not None
        return delivery


def pose(key: str, number: int) -> Message:
    return encode_pose(key, Stamp(BEGIN + number * 10_000_000), np.eye(4), "mocap")


def eventually(condition: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + 30.0
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)
    return condition()


def status() -> Message:
    return encode_status(TOPICS.status, Status(Stamp(time.time_ns()), "odometry", 0, "no frame"))


def recorded(open_peer: OpenSession, file: Path, messages: list[Message]) -> list[Message]:
    """What a recorder that is stopped at last has of the messages, which are all that came."""
    sender, receiver = open_peer(), open_peer()
    with recording(receiver, sender, file) as running:
        publisher = sender.publisher(lossless=True)
        for message in messages:
            publisher.put(message)
        assert eventually(lambda: running.taken == len(messages))
    return list(RecordingReader(file).messages())


def test_truth_without_an_image_is_recorded_at_its_own_stamps(open_peer: OpenSession, tmp_path: Path) -> None:
    poses = [pose(truth("camera"), i) for i in range(200)]
    assert recorded(open_peer, tmp_path / "a.mcap", poses) == poses


def test_status_without_anything_else_is_recorded_at_the_end(open_peer: OpenSession, tmp_path: Path) -> None:
    said = [status() for _ in range(3)]
    assert recorded(open_peer, tmp_path / "a.mcap", said) == said


@pytest.mark.parametrize("working", [False, True], ids=["only its status", "poses, too"])
def test_behind_its_source_it_waits_for_an_odometry_at_work_but_not_for_one_that_idles(
    open_peer: OpenSession, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, working: bool
) -> None:
    monkeypatch.setattr("odom.wire.idle_detector._IDLE_AFTER_S", 1.0)
    sender, receiver = open_peer(), open_peer()
    sender.announce(TOPICS.alive_of("odometry"))
    with recording(receiver, sender, tmp_path / "a.mcap") as running:
        publisher = sender.publisher()
        for message in (*session_messages(2), encode_text(TOPICS.end, Stamp(BEGIN), "end of source")):
            publisher.put(message)
        for i in range(300 if working else 3000):
            if not running.thread.is_alive():
                break
            publisher.put(pose(truth("camera"), i))
            if i % 10 == 0:
                publisher.put(status())
                if working:
                    publisher.put(pose(TOPICS.pose, i))
            time.sleep(0.01)
        assert running.thread.is_alive() == working


def test_behind_its_source_it_waits_for_an_odometry_that_is_silent_because_it_saves(
    open_peer: OpenSession, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("odom.wire.idle_detector._IDLE_AFTER_S", 0.5)
    sender, receiver, odometry = open_peer(), open_peer(), open_peer()
    odometry.announce(TOPICS.alive_of("odometry"))
    with recording(receiver, sender, tmp_path / "a.mcap") as running:
        publisher = sender.publisher()
        for message in (*session_messages(2), encode_text(TOPICS.end, Stamp(BEGIN), "end of source"), status()):
            publisher.put(message)
        time.sleep(2.0)
        assert running.thread.is_alive()
        odometry.close()
        running.thread.join(30.0)
        assert not running.thread.is_alive()
    assert [report.reason for report in running.reports] == ["end of source"]


def test_motion_capture_that_goes_on_holds_no_recording_open(open_peer: OpenSession, tmp_path: Path) -> None:
    sender, receiver = open_peer(), open_peer()
    with recording(receiver, sender, tmp_path / "a.mcap") as running:
        publisher = sender.publisher()
        for message in (*session_messages(2), encode_text(TOPICS.end, Stamp(BEGIN), "end of source")):
            publisher.put(message)
        for i in range(3000):
            if not running.thread.is_alive():
                break
            publisher.put(pose(truth("camera"), i))
            time.sleep(0.01)
        assert not running.thread.is_alive()


def test_what_has_come_while_the_disk_stalls_is_recorded_though_it_is_stopped_meanwhile(
    open_peer: OpenSession, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stalled, goes_on = threading.Event(), threading.Event()
    write = RecordingWriter.write

    def stall(writer: RecordingWriter, message: Message, at: Stamp | None = None) -> None:
        stalled.set()
        assert goes_on.wait(30.0)
        write(writer, message, at)

    monkeypatch.setattr(RecordingWriter, "write", stall)
    sender, receiver = open_peer(), open_peer()
    messages = [*session_messages(20), encode_text(TOPICS.end, Stamp(BEGIN), "end of source"), pose(TOPICS.pose, 1)]
    with recording(receiver, sender, tmp_path / "a.mcap") as running:
        publisher = sender.publisher()
        for message in messages:
            publisher.put(message)
        assert stalled.wait(30.0)
        assert eventually(lambda: running.waiting() == len(messages) - 1)
        running.stop.set()
        goes_on.set()
    assert [report.reason for report in running.reports] == ["end of source"]
    assert [(report.frames, report.lost) for report in running.reports] == [(20, 0)]
    assert len(list(RecordingReader(tmp_path / "a.mcap").messages())) == len(messages) - 1  # the end is none


def test_status_of_another_clock_is_logged_among_the_images() -> None:
    """Status stamped today beside images stamped years ago, the first status before the first image."""
    today = BEGIN + 10**17
    timeline = Timeline(IMAGES)
    logged = timeline.place(encode_status(TOPICS.status, Status(Stamp(today), "odometry", 0, "ready")))
    assert logged == []
    for message in session_messages(5):
        logged += timeline.place(message)
        logged += timeline.place(encode_status(TOPICS.status, Status(Stamp(today), "odometry", 0, "")))
    assert len(logged) == 1 + 2 * len(session_messages(5))
    assert all(BEGIN <= at < BEGIN + 10**9 for at, _ in logged)
    assert all(at == message.stamp for at, message in logged if message.topic != TOPICS.status)


def test_a_source_that_is_started_again_has_not_ended(
    open_peer: OpenSession, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("odom.wire.recorder._QUIET_S", 2.0)
    sending, receiving = open_peer(), open_peer()
    reports: list[RecorderReport] = []
    with RecordingWriter(tmp_path / "a.mcap") as writer:
        recorder = Recorder(receiving, TOPICS, writer)
        with sending.zenoh.declare_publisher(TOPICS.depth) as probe:
            while not probe.matching_status.matching:
                time.sleep(0.01)
        thread = threading.Thread(target=lambda: reports.append(recorder.run(threading.Event())), daemon=True)
        thread.start()
        for life, silence_s in (("first", 0.3), ("second", 2.8)):
            publisher = sending.publisher()
            for message in session_messages(2):
                publisher.put(message)
            if life == "first":
                publisher.put(encode_text(TOPICS.end, Stamp(BEGIN), "interrupted"))
            time.sleep(silence_s)
            assert thread.is_alive(), life
        publisher.put(encode_text(TOPICS.end, Stamp(BEGIN), "end of source"))
        thread.join(30.0)
    assert [(report.frames, report.reason) for report in reports] == [(4, "end of source")]
