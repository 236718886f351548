import threading
import time

import pytest

from odom.frame import Stamp
from odom.service.arrival_queue import EndArrival
from odom.service.frame_receiver import FrameReceiver
from odom.service.local_run import free_endpoint
from odom.wire import Topics, WireSettings
from odom.wire.codec import encode_text
from odom.wire.session import open_session
from odom.wire.settings import ANY_LOCAL_PORT


@pytest.mark.parametrize("until_end", [True, False])
def test_receiving_ends_with_the_source_only_where_that_was_asked_for(
    until_end: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    topics, endpoint = Topics(), free_endpoint()
    here = WireSettings(connect=(), listen=(endpoint,))
    there = WireSettings(connect=(endpoint,), listen=(ANY_LOCAL_PORT,))
    with open_session(here) as session, open_session(there) as sensor:
        receiver = FrameReceiver(session, topics, live_room=4)
        known, consumer = [], receiver._consumer
        report = consumer._report

        def reporting(waiting: bool) -> None:
            if consumer.ended is not None:
                known.append(receiver.source_ended)
            report(waiting)

        monkeypatch.setattr(consumer, "_report", reporting)
        receiver.start(until_end)
        publisher = sensor.publisher(lossless=True)
        deadline = time.monotonic() + 30.0
        while not publisher.is_heard(topics.end, "std_msgs/msg/String") and time.monotonic() < deadline:
            time.sleep(0.01)
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
