"""ROS bags of made-up messages, and the frames that are read from one."""

from collections.abc import Iterable
from pathlib import Path

from rosbags.convert.converter import migrate_bytes
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from odom.frame import RgbdFrame
from odom.wire import Message
from odom.wire.assembler import FrameAssembler
from sensors.catalogue import open_source
from sensors.source import SourceOptions

ROS2, ROS1 = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
LATE_NS = 80_000_000
"""How long after its capture a message is logged, as by a driver."""


def record(folder: Path, messages: Iterable[Message], plugin: StoragePlugin = StoragePlugin.MCAP) -> Path:
    """Write the messages with rosbags."""
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        connections = {}
        for message in messages:
            if message.topic not in connections:
                connections[message.topic] = writer.add_connection(
                    f"/{message.topic}", message.type_name, typestore=ROS2
                )
            writer.write(connections[message.topic], message.stamp + LATE_NS, message.payload)
    return folder


def record_ros_1(path: Path, messages: Iterable[Message]) -> Path:
    """Write the messages as a bag of ROS 1."""
    with Ros1Writer(path) as writer:
        connections = {}
        for message in messages:
            name = message.type_name
            if message.topic not in connections:
                connections[message.topic] = writer.add_connection(f"/{message.topic}", name, typestore=ROS1)
            raw = migrate_bytes(ROS2, ROS1, name, name, {}, message.payload, src_is2=True, dst_is2=False)
            writer.write(connections[message.topic], message.stamp + LATE_NS, raw)
    return path


def frames_in(spec: Path, options: SourceOptions | None = None) -> tuple[list[RgbdFrame], FrameAssembler]:
    """Return the frames of a source, and what has put them together."""
    options = options or SourceOptions()
    assembler = FrameAssembler(options.topics)
    frames = [frame for message in open_source(str(spec), options).messages() for frame in assembler.feed(message)]
    return [*frames, *assembler.finish()], assembler
