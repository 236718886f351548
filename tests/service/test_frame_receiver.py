import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from odom.frame import Camera, Stamp
from odom.service.arrival_queue import EndArrival, TruthArrival
from odom.service.frame_receiver import FrameReceiver
from odom.service.local_run import free_endpoint
from odom.wire import Topics, WireSettings, truth
from odom.wire.codec import encode_camera_info, encode_pose, encode_text
from odom.wire.session import Publisher, WireSession, open_session
from odom.wire.settings import ANY_LOCAL_PORT


@pytest.fixture
def sessions() -> Iterator[tuple[WireSession, WireSession]]:
    """Those of the receiver and of the sensor."""
    endpoint = free_endpoint()
    here = WireSettings(connect=(), listen=(endpoint,))
    there = WireSettings(connect=(endpoint,), listen=(ANY_LOCAL_PORT,))
    with open_session(here) as session, open_session(there) as sensor:
        yield session, sensor


def heard(sensor: WireSession, topics: Topics) -> Publisher:
    """A publisher to which the receiver listens."""
    publisher = sensor.publisher(lossless=True)
    deadline = time.monotonic() + 30.0
    while not publisher.is_heard(topics.end, "std_msgs/msg/String") and time.monotonic() < deadline:
        time.sleep(0.01)
    return publisher


@pytest.mark.parametrize("until_end", [True, False])
def test_receiving_ends_with_the_source_only_where_that_was_asked_for(
    sessions: tuple[WireSession, WireSession], until_end: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    topics = Topics()
    session, sensor = sessions
    receiver = FrameReceiver(session, topics, live_room=4)
    known, consumer = [], receiver._consumer
    report = consumer._report

    def reporting(waiting: bool) -> None:
        if consumer.ended is not None:
            known.append(receiver.source_ended)
        report(waiting)

    monkeypatch.setattr(consumer, "_report", reporting)
    receiver.start(until_end)
    publisher = heard(sensor, topics)
    publisher.put(encode_text(topics.end, Stamp(1), "end of source"))
    arrival = receiver.arrivals.take(30.0)
    assert isinstance(arrival, EndArrival)
    assert arrival.reason == "end of source"
    assert known[0], "known before the sensor hears that its end has come, and goes"
    intake = next((thread for thread in threading.enumerate() if thread.name == "intake"), None)
    if intake is not None and until_end:
        intake.join(timeout=10.0)
    assert (intake is not None and intake.is_alive()) is not until_end
    receiver.close()


def test_a_source_that_has_ended_has_ended_though_motion_capture_goes_on(
    sessions: tuple[WireSession, WireSession],
) -> None:
    topics = Topics()
    session, sensor = sessions
    receiver = FrameReceiver(session, topics, live_room=4)
    receiver.start()
    publisher = heard(sensor, topics)
    publisher.put(encode_text(topics.end, Stamp(1), "end of source"))
    assert isinstance(receiver.arrivals.take(30.0), EndArrival)
    publisher.put(encode_pose(truth("camera"), Stamp(2), np.eye(4), "mocap"))
    assert isinstance(receiver.arrivals.take(30.0), TruthArrival)
    assert receiver.source_ended
    publisher.put(encode_camera_info(topics.camera_info, Stamp(3), Camera(640, 480, 525.0, 525.0, 319.5, 239.5)))
    deadline = time.monotonic() + 30.0
    while receiver.source_ended and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not receiver.source_ended
    receiver.close()
