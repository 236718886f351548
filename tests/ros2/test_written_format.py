"""The written format of rmw_zenoh, by examples: those of its design document, and one for each type that is sent."""

import pytest

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire import Topics, topics
from odom.wire.ros2.attachment import RosAttachment, gid_of, ros_attachment_of
from odom.wire.ros2.names import Endpoint, NodeName, data_key, endpoint_of, topic_name, type_hash
from odom.wire.ros2.node import qos_of_key
from odom.wire.ros2.qos import Qos, qos_of
from odom.wire.ros2.static_frames import TF_STATIC

STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
HASHES = {
    "sensor_msgs/msg/Image": "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
    "sensor_msgs/msg/CompressedImage": "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
    "sensor_msgs/msg/CameraInfo": "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275",
    "sensor_msgs/msg/PointCloud2": "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    "nav_msgs/msg/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "nav_msgs/msg/Path": "1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b",
    "geometry_msgs/msg/PoseStamped": "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "diagnostic_msgs/msg/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "std_msgs/msg/String": STRING.removeprefix("RIHS01_"),
}
"""What the official type descriptions of Jazzy and Kilted carry."""
TALKER = NodeName(2, "8b20917502ee955ac4476e0266340d5c", 0, "/", "talker")
CHATTER = Endpoint(TALKER, 10, "MP", "/chatter", "std_msgs/msg/String", STRING, Qos(depth=7))
CHATTER_TOKEN = (
    "@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/"
    f"std_msgs::msg::dds_::String_/{STRING}/::,7:,:,:,,"
)


def test_keys_and_tokens_are_those_of_the_design_document() -> None:
    assert data_key(0, "/robot1/chatter", "std_msgs/msg/String", STRING) == (
        f"0/robot1/chatter/std_msgs::msg::dds_::String_/{STRING}"
    )
    assert TALKER.token() == "@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/0/NN/%/%/talker"
    assert CHATTER.token() == CHATTER_TOKEN
    assert CHATTER.key() == f"2/chatter/std_msgs::msg::dds_::String_/{STRING}"


@pytest.mark.parametrize("type_name", HASHES)
def test_the_hash_of_a_type_is_that_of_its_official_description(type_name: str) -> None:
    assert type_hash(type_name) == f"RIHS01_{HASHES[type_name]}"


def test_every_type_of_the_contract_has_an_example_here() -> None:
    assert {key.type_name for key in topics._KEYS} | {"tf2_msgs/msg/TFMessage"} <= HASHES.keys()


def test_a_node_below_a_namespace_has_percent_signs_for_slashes() -> None:
    node = NodeName(0, "ab", 3, "/rig/cam1", "odometry")
    assert node.token() == "@ros2_lv/0/ab/3/3/NN/%/%rig%cam1/odometry"
    assert node.full_name == "/rig/cam1/odometry"
    assert NodeName(0, "ab", 3, "/", "sensor").full_name == "/sensor"


def test_an_attachment_is_33_bytes_and_read_back() -> None:
    packed = RosAttachment(1, Stamp(2), bytes(range(16))).pack()
    assert packed.hex() == "0100000000000000" + "0200000000000000" + "10" + bytes(range(16)).hex()
    assert ros_attachment_of(packed) == (1, 2, bytes(range(16)))
    assert ros_attachment_of(packed[:-1]) is None
    assert ros_attachment_of(packed[:16] + b"\x11" + packed[17:]) is None


def test_the_gid_is_the_hash_of_the_token_lower_half_first() -> None:
    # XXH3-128 of no bytes, published with the reference implementation: high 99aa06d3014798d8, low 6001c324468d497f
    assert gid_of("") == bytes.fromhex("6001c324468d497f")[::-1] + bytes.fromhex("99aa06d3014798d8")[::-1]


@pytest.mark.parametrize(
    ("qos", "token"),
    [
        (Qos(depth=42), "::,:,:,:,,"),
        (Qos(depth=10), "::,10:,:,:,,"),
        (Qos(depth=1, transient_local=True), ":1:,1:,:,:,,"),
        (Qos(depth=5, reliable=False), "2::,5:,:,:,,"),
        (Qos(depth=0), "::2,:,:,:,,"),
    ],
)
def test_quality_of_service_names_only_what_differs_from_the_defaults(qos: Qos, token: str) -> None:
    assert qos.token() == token
    assert qos_of(token) == qos


@pytest.mark.parametrize("token", ["", "x", "1:2", "::,x:,:,:,,", ":::::::", "::1,5:,:,:,,/more"])
def test_a_quality_that_cannot_be_read_stands_for_the_default(token: str) -> None:
    assert qos_of(token).reliable


def test_a_token_is_read_back() -> None:
    below = NodeName(7, "ab", 1, "/rig/cam1", "sensor")
    image = Endpoint(
        below, 4, "MS", "/rig/cam1/color/image_raw", "sensor_msgs/msg/Image", "TypeHashNotSupported", Qos()
    )
    for endpoint in (CHATTER, image):
        assert endpoint_of(endpoint.token()) == endpoint


@pytest.mark.parametrize(
    "token",
    [
        "",
        TALKER.token(),
        CHATTER_TOKEN.replace("/MP/", "/SS/"),
        CHATTER_TOKEN.replace("@ros2_lv", "other"),
        CHATTER_TOKEN.replace("/10/", "/x/"),
        CHATTER_TOKEN.replace("std_msgs::msg::dds_::String_", "String"),
        CHATTER_TOKEN + "/more",
    ],
)
def test_a_token_of_something_else_is_no_endpoint(token: str) -> None:
    assert endpoint_of(token) is None


def test_a_part_of_a_topic_never_begins_with_a_digit() -> None:
    assert topic_name("truth/1/pose") == "/truth/n1/pose"
    assert topic_name(Topics("cam1").odom) == "/cam1/odom"


@pytest.mark.parametrize("name", ["Image", "sensor_msgs/Image", "sensor_msgs/srv/Image", "a/msg/B/C", "a/msg/B*", ""])
def test_what_is_no_message_type_is_refused(name: str) -> None:
    with pytest.raises(WireError, match="no message type of ROS 2"):
        data_key(0, "/x", name, STRING)


def test_a_type_that_ros_does_not_define_has_no_hash() -> None:
    with pytest.raises(WireError, match="is not known"):
        type_hash("sensor_msgs/msg/Nothing")


def test_calibration_paths_and_static_frames_are_kept_for_late_joiners() -> None:
    keys = Topics("rig/cam1")
    kept = (keys.camera_info, keys.path, f"{keys.path}/segment_2", TF_STATIC)
    assert all(qos_of_key(key).transient_local for key in kept)
    assert not any(qos_of_key(key).transient_local for key in (keys.color, keys.odom, keys.status, "tf"))
