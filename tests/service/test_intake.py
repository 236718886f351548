"""What waits for the odometry, of a live sensor that is faster than it."""

import time
from collections.abc import Iterator

import numpy as np
import pytest

from odom.frame import Camera, Stamp
from odom.service.intake import Arrival, FrameArrival, Intake
from odom.wire import Topics, WireSettings
from odom.wire.codec import encode_camera_info, encode_color, encode_depth
from odom.wire.session import Publisher, WireSession, open_session

TOPICS = Topics()
ROOM = 3


@pytest.fixture
def session() -> Iterator[WireSession]:
    with open_session(WireSettings(connect=(), listen=())) as session:
        yield session


def send(publisher: Publisher, frames: range) -> None:
    """Publish frames of 30 Hz as a live sensor does, a little faster."""
    color, depth = np.zeros((48, 64, 3), dtype=np.uint8), np.full((48, 64), 1000, dtype=np.uint16)
    for k in frames:
        stamp = Stamp(1_000_000_000 + k * 33_333_333)
        if k == 0:
            publisher.put(encode_camera_info(TOPICS.camera_info, stamp, Camera(64, 48, 50, 50, 32, 24)))
        publisher.put(encode_color(TOPICS.color, stamp, color))
        publisher.put(encode_depth(TOPICS.depth, stamp, depth))
        time.sleep(0.005)


def frames_of(arrivals: list[Arrival]) -> list[int]:
    return [arrival.frame.sequence for arrival in arrivals if isinstance(arrival, FrameArrival)]


def test_a_live_sensors_first_second_is_kept_and_then_the_newest_frames_win(session: WireSession) -> None:
    intake, publisher = Intake(session, TOPICS, ROOM), session.publisher()
    intake.start()
    begun = time.monotonic()
    send(publisher, range(20))
    assert time.monotonic() - begun < 0.8, "too slow a machine to tell"
    time.sleep(0.1)
    assert intake.overtaken == 0
    time.sleep(1.0)
    send(publisher, range(20, 25))
    time.sleep(0.1)
    intake.close()
    assert frames_of(list(intake.drain())) == [22, 23, 24]
    assert intake.overtaken == 22
