import threading
import time
from pathlib import Path

from made_up_messages import BEGIN, session_messages
from private_network import OpenSession

from odom.frame import Stamp
from odom.wire import Topics
from odom.wire.codec import Status, encode_status, encode_text
from odom.wire.recorder import Recorder, RecorderReport, Timeline
from odom.wire.recording import RecordingWriter

TOPICS = Topics()
IMAGES = (TOPICS.color_compressed, TOPICS.depth, TOPICS.camera_info)


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


def test_a_source_that_is_started_again_has_not_ended(open_peer: OpenSession, tmp_path: Path) -> None:
    sending, receiving = open_peer(), open_peer()
    reports: list[RecorderReport] = []
    with RecordingWriter(tmp_path / "a.mcap") as writer:
        recorder = Recorder(receiving, TOPICS, writer)
        with sending.zenoh.declare_publisher(TOPICS.depth) as probe:
            while not probe.matching_status.matching:
                time.sleep(0.01)
        thread = threading.Thread(target=lambda: reports.append(recorder.run(threading.Event())), daemon=True)
        thread.start()
        for life, silence_s in (("first", 0.3), ("second", 1.8)):
            publisher = sending.publisher()
            for message in session_messages(2):
                publisher.put(message)
            if life == "first":
                publisher.put(encode_text(TOPICS.end, Stamp(BEGIN), "interrupted"))
            time.sleep(silence_s)
            assert thread.is_alive(), life
        publisher.put(encode_text(TOPICS.end, Stamp(BEGIN), "end of source"))
        thread.join(5.0)
    assert [(report.frames, report.reason) for report in reports] == [(4, "end of source")]
