"""Folders of ROS 2 bags as they lie about: compressed, with foreign files beside, and below odd names."""

import shutil
from pathlib import Path

import pytest
from made_up_bags import LATE_NS, ROS2, frames_in, record
from made_up_messages import BEGIN, PERIOD_NS, kinect_depth, textured
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from odom.cli.info import info
from odom.errors import ConfigError, RecordingError
from odom.frame import Camera, Stamp
from odom.wire import Message
from odom.wire.codec import encode_camera_info, encode_color, encode_depth
from odom.wire.recording import open_reader
from sensors.catalogue import open_source
from sensors.source import SourceOptions

CAMERA = Camera(64, 48, 50.0, 51.0, 31.0, 23.0)
FRAMES = 6
MAC_OS = b"\0\x05\x16\x07\0\2\0\0Mac OS X        " + b"\0" * 4000
"""How the file begins that macOS puts beside each one on a foreign disk."""


def walk(begin: int = BEGIN) -> list[Message]:
    stamps = [Stamp(begin + i * PERIOD_NS) for i in range(FRAMES)]
    return [
        message
        for stamp in stamps
        for message in (
            encode_color("camera/color/image_raw", stamp, textured()),
            encode_camera_info("camera/color/camera_info", stamp, CAMERA),
            encode_depth("camera/depth_registered/image_raw", stamp, kinect_depth()),
        )
    ]


def compressed(folder: Path, plugin: StoragePlugin, mode: CompressionMode) -> Path:
    writer = Writer(folder, version=8, storage_plugin=plugin)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for message in walk():
            if message.topic not in connections:
                connections[message.topic] = writer.add_connection(
                    f"/{message.topic}", message.type_name, typestore=ROS2
                )
            writer.write(connections[message.topic], message.stamp + LATE_NS, message.payload)
    return folder


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_a_bag_that_was_compressed_by_file_or_message_is_read_by_its_metadata(
    tmp_path: Path, plugin: StoragePlugin, mode: CompressionMode, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = compressed(tmp_path / "bag", plugin, mode)
    assert len(frames_in(bag)[0]) == FRAMES
    info(bag)
    assert "colour /camera/color/image_raw" in capsys.readouterr().out


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_compressed_file_alone_is_told_with_what_unpacks_it(tmp_path: Path, plugin: StoragePlugin) -> None:
    bag = compressed(tmp_path / "bag", plugin, CompressionMode.FILE)
    (bag / "metadata.yaml").unlink()
    for path in (bag, next(bag.iterdir())):
        with pytest.raises(ConfigError, match="zstd -d"):
            open_source(str(path), SourceOptions())
        with pytest.raises(RecordingError, match="zstd -d"):
            open_reader(path)


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_file_of_compressed_messages_alone_is_told_that_its_metadata_is_needed(
    tmp_path: Path, plugin: StoragePlugin
) -> None:
    bag = compressed(tmp_path / "bag", plugin, CompressionMode.MESSAGE)
    (part,) = (file for file in bag.iterdir() if file.suffix != ".yaml")
    with pytest.raises(RecordingError, match=r"6 messages of /camera/.*compressed by itself.*metadata\.yaml"):
        open_source(str(part), SourceOptions())


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_hidden_files_are_no_part_of_a_bag(tmp_path: Path, plugin: StoragePlugin) -> None:
    bag = record(tmp_path / "bag", walk(), plugin)
    part = next(file for file in bag.iterdir() if file.suffix != ".yaml")
    part.with_name(f"._{part.name}").write_bytes(MAC_OS)
    assert len(frames_in(bag)[0]) == FRAMES
    if plugin == StoragePlugin.SQLITE3:
        (bag / "metadata.yaml").unlink()
        assert len(frames_in(bag)[0]) == FRAMES


def test_a_recording_that_lies_beside_the_parts_of_a_bag_is_no_part_of_it(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", walk())
    other = record(tmp_path / "other", walk(BEGIN + 10**10))
    shutil.copy(other / "other.mcap", bag / "bag_cut.mcap")
    assert len(frames_in(bag)[0]) == FRAMES
    (bag / "metadata.yaml").write_text("of another program")
    assert len(frames_in(bag)[0]) == 2 * FRAMES


@pytest.mark.parametrize("name", ["take #3", "what?", "50%20x", "100% done"])
def test_a_database_bag_is_opened_whatever_its_folder_and_files_are_called(tmp_path: Path, name: str) -> None:
    bag = record(tmp_path / "bag", walk(), StoragePlugin.SQLITE3)
    moved = shutil.copytree(bag, tmp_path / name)
    (database,) = moved.glob("*.db3")
    paths = [moved, database]
    renamed = shutil.copytree(bag, tmp_path / f"renamed {name}")
    metadata = renamed / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("bag.db3", f"{name}.db3"))
    paths += [renamed, (renamed / "bag.db3").rename(renamed / f"{name}.db3")]
    for path in paths:
        assert len(frames_in(path)[0]) == FRAMES
