from made_up_messages import BEGIN, session_messages

from odom.frame import Stamp
from odom.wire import Topics
from odom.wire.codec import Status, encode_status
from odom.wire.recorder import Timeline

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
