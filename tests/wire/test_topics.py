import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from odom.errors import ConfigError
from odom.wire import TRUTH, TRUTH_HISTORY, Topics, truth, truth_history
from odom.wire.codec import cdr
from odom.wire.topics import type_of


@given(st.text())
def test_a_body_of_any_name_has_a_key_below_those_that_are_listened_to(body: str) -> None:
    for key, expression in ((truth(body), TRUTH), (truth_history(body), TRUTH_HISTORY)):
        assert zenoh.KeyExpr(expression).includes(zenoh.KeyExpr(key))
        assert len(key.split("/")[1]) <= 64
    assert truth(truth(body).split("/")[1]) == truth(body)


def test_the_history_of_a_device_is_below_its_namespace() -> None:
    topics = Topics("rig/cam1")
    assert (topics.history, topics.odom_history) == ("rig/cam1/history", "rig/cam1/history/odom")
    assert truth_history("camera rig") == "truth/camera_rig/history"


@pytest.mark.parametrize("name", ["truth", "truth/a"])
def test_no_device_has_the_namespace_of_motion_capture(name: str) -> None:
    with pytest.raises(ConfigError, match="give another name"):
        Topics(name)
    assert Topics("truthful").namespace == "truthful"


@pytest.mark.parametrize(
    ("key", "type_name"),
    [
        ("cam0/color/image_raw", cdr.IMAGE),
        ("rig/cam1/depth/image_raw/compressedDepth", cdr.COMPRESSED_IMAGE),
        ("cam0/color/camera_info", cdr.CAMERA_INFO),
        ("truth/rig/pose", cdr.POSE),
        ("cam0/odom", cdr.ODOMETRY),
        ("cam0/chain", cdr.ODOMETRY),
        ("cam0/chain/closed", cdr.PATH),
        ("rig/cam1/history/odom", cdr.PATH),
        ("tf", cdr.TRANSFORMS),
        ("cam0/history", None),
        ("cam0/ack/recorder", None),
        ("image_raw_of_another_kind", None),
    ],
)
def test_a_foreign_message_has_the_type_that_its_key_stands_for(key: str, type_name: str | None) -> None:
    assert type_of(key) == type_name
