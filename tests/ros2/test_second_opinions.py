"""The written format against two implementations that are not ours: `zenoh-ros2-sdk` and `pamoja-ros2`."""

import importlib
from types import ModuleType

import pytest

from odom.frame import Stamp
from odom.wire import TF, Topics, topics, truth
from odom.wire.codec import schema
from odom.wire.ros2.attachment import RosAttachment
from odom.wire.ros2.names import PUBLISHER, SUBSCRIBER, Endpoint, Kind, NodeName, data_key, topic_name, type_hash
from odom.wire.ros2.node import qos_of_key
from odom.wire.ros2.qos import Qos
from odom.wire.ros2.static_frames import TF_STATIC

KEYS = [(key.__get__(Topics("rig/cam1"), Topics), key.type_name) for key in topics._KEYS] + [
    (TF, "tf2_msgs/msg/TFMessage"),
    (TF_STATIC, "tf2_msgs/msg/TFMessage"),
    (truth("1 b"), "geometry_msgs/msg/PoseStamped"),
]


@pytest.fixture(scope="module")
def pamoja() -> ModuleType:
    return pytest.importorskip("pamoja.ros2", reason="the wheel pamoja-ros2 is missing")


def sdk(name: str) -> ModuleType:
    pytest.importorskip("zenoh_ros2_sdk", reason="the wheel zenoh-ros2-sdk is missing")
    return importlib.import_module(f"zenoh_ros2_sdk.{name}")


@pytest.mark.parametrize(("key", "type_name"), KEYS)
def test_pamoja_makes_the_same_key(pamoja: ModuleType, key: str, type_name: str) -> None:
    name, hashed = topic_name(key), type_hash(type_name)
    assert pamoja.is_valid_name(name)
    assert pamoja.is_fully_qualified(name)
    assert pamoja.entity_key(0, name, type_name, hashed) == data_key(0, name, type_name, hashed)
    assert bytes(pamoja.type_hash_digest(hashed)).hex() == hashed.removeprefix("RIHS01_")


@pytest.mark.process  # importing it starts git
@pytest.mark.parametrize(("key", "type_name"), KEYS)
def test_the_sdk_makes_the_same_hash_key_and_token(key: str, type_name: str) -> None:
    definition, *used = schema(type_name).decode().split("=" * 80)
    parts = dict(part.strip().removeprefix("MSG: ").split("\n", 1) for part in used)
    dependencies = {
        name.strip().replace("/", "/msg/") if "/msg/" not in name else name: text for name, text in parts.items()
    }
    hashed = sdk("utils").get_type_hash(type_name, msg_definition=definition, dependencies=dependencies)
    assert type_hash(type_name) == hashed

    name, qos = topic_name(key), qos_of_key(key)
    theirs_node = sdk("entity").NodeEntity(7, "ab12", 0, "odometry", "/rig/cam1")
    kinds: tuple[Kind, ...] = (PUBLISHER, SUBSCRIBER)
    for kind in kinds:
        ours = Endpoint(NodeName(7, "ab12", 0, "/rig/cam1", "odometry"), 3, kind, name, type_name, hashed, qos)
        dds = sdk("utils").ros2_to_dds_type(type_name)
        written = sdk("entity").EntityKind(kind)
        theirs = sdk("entity").EndpointEntity(theirs_node, 3, written, name, dds, hashed, _their_qos(qos))
        assert ours.token() == sdk("keyexpr").endpoint_liveliness_keyexpr(theirs)
        assert ours.node.token() == sdk("keyexpr").node_liveliness_keyexpr(theirs_node)
        assert ours.key() == sdk("keyexpr").topic_keyexpr(7, name, dds, hashed)


@pytest.mark.process
def test_the_sdk_writes_and_reads_the_same_attachment() -> None:
    ours = RosAttachment(5, Stamp(1_700_000_000_000_000_000), bytes(range(16)))
    theirs = sdk("attachment").Attachment(*ours)
    assert ours.pack() == theirs.to_bytes()
    assert sdk("attachment").Attachment.from_bytes(ours.pack()) == theirs


def _their_qos(qos: Qos) -> str:
    """Return the SDK's own writing; its defaults are those of DDS (depth 10), which it writes all the same."""
    module = sdk("qos")
    kept = module.QosDurability.TRANSIENT_LOCAL if qos.transient_local else module.QosDurability.VOLATILE
    return str(module.QosProfile(durability=kept, history_depth=qos.depth).encode())
