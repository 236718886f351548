"""Recordings that another program made: rosbags' own writer, foreign names, every encoding of depth."""

import os
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pytest
from made_up_bags import ROS2, frames_in, record, record_ros_1
from made_up_messages import BEGIN, PERIOD_NS, kinect_depth, mono16, plain_png, textured
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin

from odom.cli.info import info
from odom.errors import ConfigError, RecordingError
from odom.frame import Camera, Stamp
from odom.wire import Message, Topics
from odom.wire.assembler import FrameAssembler
from odom.wire.codec import (
    cdr,
    encode_camera_info,
    encode_color,
    encode_color_jpeg,
    encode_depth,
    encode_depth_compressed,
    encode_pose,
    restamp,
)
from odom.wire.codec import (
    image_messages as images,
)
from odom.wire.recording import RecordingWriter, mcap_file, mcap_order, open_reader, writer
from odom.wire.recording.mcap_chunk import read_chunk
from odom.wire.recording.stream_selection import select_streams
from sensors import replay
from sensors.calibration_file import Calibration, calibration_text
from sensors.catalogue import open_source
from sensors.source import SourceOptions

CAMERA = Camera(64, 48, 50.0, 51.0, 31.0, 23.0, (0.1, 0.0, 0.0, 0.0, 0.0))
FRAMES = 6
OTHER = Path("camera") / "infra1" / "image_rect_raw"

Encode = Callable[[str, Stamp, np.ndarray], Message]


def metres(topic: str, stamp: Stamp, depth: np.ndarray) -> Message:
    depth_m = np.where(depth > 0, depth / np.float32(1000), np.float32(np.nan)).astype(np.float32)
    return images._encode_image(topic, stamp, depth_m, "32FC1", "camera")


def png(topic: str, stamp: Stamp, depth: np.ndarray) -> Message:
    return encode_depth_compressed(topic, stamp, depth, codec="png")


def rvl(topic: str, stamp: Stamp, depth: np.ndarray) -> Message:
    return encode_depth_compressed(topic, stamp, depth, codec="rvl")


def bgr(topic: str, stamp: Stamp, color: np.ndarray) -> Message:
    return images._encode_image(topic, stamp, np.ascontiguousarray(color[..., ::-1]), "bgr8", "camera")


def jpeg(topic: str, stamp: Stamp, color: np.ndarray) -> Message:
    return encode_color_jpeg(topic, stamp, color, quality=100)


def realsense(color: Encode = bgr, depth: Encode = encode_depth) -> list[Message]:
    """The topics of a well-known driver, with what else it publishes."""
    messages = []
    for i in range(FRAMES):
        stamp, late = Stamp(BEGIN + i * PERIOD_NS), Stamp(BEGIN + i * PERIOD_NS + 7_000_000)
        messages += [
            depth("camera/aligned_depth_to_color/image_raw", stamp, kinect_depth(seed=i)),
            encode_depth("camera/depth/image_rect_raw", stamp, kinect_depth(24, 32, seed=i)),
            encode_color("camera/infra1/image_rect_raw", stamp, textured(seed=i)[..., 0]),
            encode_camera_info("camera/aligned_depth_to_color/camera_info", stamp, Camera(64, 48, 1, 1, 1, 1)),
            encode_camera_info("camera/depth/camera_info", stamp, Camera(32, 24, 1, 1, 1, 1)),
            color("camera/color/image_raw", late, textured(seed=i)),
            encode_camera_info("camera/color/camera_info", late, CAMERA),
            encode_pose("vicon/helmet/pose", late, np.eye(4), "vicon"),
        ]
    return messages


def frames_of(
    spec: Path, options: SourceOptions | None = None
) -> tuple[list[tuple[np.ndarray, np.ndarray]], FrameAssembler]:
    frames, assembler = frames_in(spec, options)
    return [(frame.color, frame.depth_mm) for frame in frames], assembler


@pytest.mark.parametrize("depth", [encode_depth, metres, png, rvl])
@pytest.mark.parametrize("color", [bgr, jpeg])
def test_frames_are_found_by_type_in_foreign_recordings(tmp_path: Path, color: Encode, depth: Encode) -> None:
    bag = record(tmp_path / "bag", realsense(color, depth))
    for spec in (bag, *bag.glob("*.mcap")):
        frames, assembler = frames_of(spec)
        assert assembler.camera == CAMERA
        assert len(frames) == FRAMES
        for i, (rgb, mm) in enumerate(frames):
            assert np.array_equal(mm, kinect_depth(seed=i))
            assert np.abs(rgb.astype(int) - textured(seed=i)).mean() < (1e-9 if color is bgr else 4)


def test_database_bags_read_alike(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", realsense(), StoragePlugin.SQLITE3)
    frames, assembler = frames_of(bag)
    assert len(frames) == FRAMES
    assert assembler.camera == CAMERA
    assert open_source(str(bag), SourceOptions()).length == FRAMES


def test_a_database_is_read_without_its_metadata_and_as_a_file(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", realsense(), StoragePlugin.SQLITE3)
    (bag / "metadata.yaml").unlink()
    for spec in (bag, *bag.glob("*.db3")):
        frames, assembler = frames_of(spec)
        assert len(frames) == FRAMES
        assert assembler.camera == CAMERA


def test_a_bag_of_ros_1_is_read_alike(tmp_path: Path) -> None:
    path = record_ros_1(tmp_path / "take.bag", realsense())
    frames, assembler = frames_of(path)
    assert assembler.camera == CAMERA
    assert len(frames) == FRAMES
    for i, (rgb, mm) in enumerate(frames):
        assert np.array_equal(mm, kinect_depth(seed=i))
        assert np.array_equal(rgb, textured(seed=i))
    assert open_source(str(path), SourceOptions()).length == FRAMES
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(RecordingError, match="ROS 1 bag"):
        open_source(str(path), SourceOptions())


def grey_16(topic: str, stamp: Stamp, color: np.ndarray, big: int = 0) -> Message:
    return mono16(topic, stamp, color[..., 0].astype(np.uint16) * 256 + 17, big)


@pytest.mark.parametrize("big", [0, 1])
def test_colour_in_16_bits_of_grey_is_colour_by_its_name(tmp_path: Path, big: int) -> None:
    frames, _ = frames_of(record(tmp_path / "bag", realsense(partial(grey_16, big=big))))
    assert len(frames) == FRAMES
    assert np.array_equal(frames[3][0], textured(seed=3)[..., 0])


@pytest.mark.parametrize("has_color", [False, True])
def test_infrared_images_in_16_bits_stand_in_for_colour_where_there_is_none(tmp_path: Path, has_color: bool) -> None:
    messages = []
    for i in range(FRAMES):
        stamp = Stamp(BEGIN + i * PERIOD_NS)
        messages += [
            grey_16("ir/image_raw", stamp, textured(seed=100 + i)),
            encode_camera_info("ir/camera_info", stamp, CAMERA),
            encode_depth("depth/image_raw", stamp, kinect_depth(seed=i)),
            *([bgr("rgb/image_raw", stamp, textured(seed=i))] if has_color else []),
        ]
    frames, _ = frames_of(record(tmp_path / "bag", messages))
    assert len(frames) == FRAMES
    assert np.array_equal(frames[3][0], textured(seed=3) if has_color else textured(seed=103)[..., 0])
    assert np.array_equal(frames[3][1], kinect_depth(seed=3))


def test_depth_whose_format_is_just_png_is_known_by_its_bits(tmp_path: Path) -> None:
    messages = [
        replace(message, topic=message.topic.replace("aligned_depth_to_color", "range"))
        for message in realsense(plain_png, plain_png)
        if not message.topic.startswith(("camera/depth", "camera/infra1"))
    ]
    selected = select_streams(open_reader(record(tmp_path / "bag", messages)).streams(), {})
    assert (selected.color.topic, selected.depth.topic) == ("camera/color/image_raw", "camera/range/image_raw")
    frames, _ = frames_of(tmp_path / "bag")
    assert len(frames) == FRAMES
    assert np.array_equal(frames[2][1], kinect_depth(seed=2))


def test_colour_in_a_png_of_16_bits_of_grey_is_colour_by_its_name(tmp_path: Path) -> None:
    def deep_grey(topic: str, stamp: Stamp, color: np.ndarray) -> Message:
        return plain_png(topic, stamp, color[..., 0].astype(np.uint16) * 257)

    frames, _ = frames_of(record(tmp_path / "bag", realsense(deep_grey)))
    assert len(frames) == FRAMES


def under(folder: str, messages: list[Message]) -> list[Message]:
    return [replace(message, topic=f"{folder}/{message.topic}") for message in messages]


def test_depth_is_that_of_colours_own_camera_and_no_image_of_another_kind_though_there_are_more_of_it(
    tmp_path: Path,
) -> None:
    mine, other = under("left", realsense()), under("right", realsense())
    depth = "left/camera/aligned_depth_to_color/image_raw"
    mine.remove(next(message for message in mine if message.topic == depth))
    late = [m for m in other if m.topic.endswith("color/image_raw")]
    infrared = [encode_depth("left/camera/ir/image_raw", m.stamp, kinect_depth(seed=9)) for m in late]
    messages = sorted([*mine, *infrared, *(m for m in other if m not in late)], key=lambda m: m.stamp)
    selected = select_streams(open_reader(record(tmp_path / "bag", messages)).streams(), {})
    assert selected.color.topic == "left/camera/color/image_raw"
    assert selected.depth.topic == depth


def test_the_parts_of_a_bag_are_read_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    stamps = [Stamp(BEGIN + i * PERIOD_NS) for i in range(12 * 60)]
    for part in range(12):
        with RecordingWriter(tmp_path / f"bag_{part}.mcap") as writer:
            for stamp in stamps[60 * part : 60 * (part + 1)]:
                writer.write(encode_pose("truth/rig/pose", stamp, np.eye(4), "mocap"))
    assert [message.stamp for message in open_reader(tmp_path).messages()] == stamps


def walk_of(frames: int, height: int, width: int) -> list[Message]:
    """Colour, depth and calibration of a walk at 30 Hz, in the order of time."""
    messages = []
    for i in range(frames):
        stamp = Stamp(BEGIN + i * PERIOD_NS)
        messages += [
            encode_depth("camera/depth_registered/image_raw", stamp, kinect_depth(height, width, seed=i)),
            encode_color("camera/color/image_raw", stamp, textured(height, width, seed=i)),
            encode_camera_info("camera/color/camera_info", stamp, Camera(width, height, 50.0, 51.0, 31.0, 23.0)),
        ]
    return messages


@pytest.mark.parametrize("size", [(24, 32), (120, 160)], ids=["in one chunk", "in many"])
def test_messages_that_were_written_topic_after_topic_come_in_the_order_of_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: tuple[int, int]
) -> None:
    monkeypatch.setattr(replay, "_PEEK_BYTES", 100_000)  # as in long recordings: less than one topic
    walk = walk_of(90, *size)
    bag = record(tmp_path / "bag", sorted(walk, key=lambda message: message.topic))
    for spec in (bag, *bag.glob("*.mcap")):
        reader = open_reader(spec)
        assert [message.stamp for message in reader.messages()] == [message.stamp for message in walk]
        assert reader.complete
        frames, _ = frames_of(spec)
        assert len(frames) == 90
    middle = Stamp(BEGIN + 60 * PERIOD_NS)
    assert [message.stamp for message in reader.messages(start=middle)] == [
        message.stamp for message in walk if message.stamp >= middle
    ]


@pytest.mark.parametrize("kind", ["mcap", "mcap without chunks", "database", "ROS 1"])
def test_a_camera_that_begins_behind_the_part_looked_at_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.setattr(replay, "_PEEK_BYTES", 100_000)
    before = [encode_color("wide/image_raw", Stamp(BEGIN - i * PERIOD_NS), textured(96, 128)) for i in range(20, 0, -1)]
    messages = [*before, *realsense()]
    if kind == "mcap without chunks":
        path = without_chunks(tmp_path / "take.mcap", messages)
    elif kind == "ROS 1":
        path = record_ros_1(tmp_path / "take.bag", messages)
    else:
        path = record(tmp_path / "b", messages, StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3)
    frames, assembler = frames_of(path)
    assert len(frames) == FRAMES
    assert assembler.camera == CAMERA


def test_of_a_file_in_chunks_only_those_with_wanted_topics_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writer, "_CHUNK_BYTES", 10_000)
    with RecordingWriter(tmp_path / "walk.mcap") as written:
        for message in walk_of(30, 48, 64):
            written.write(message)
        for i in range(30):
            written.write(encode_pose("late", Stamp(BEGIN + (30 + i) * PERIOD_NS), np.eye(4), "world"))
    unpacked = []
    monkeypatch.setattr(mcap_file, "read_chunk", lambda *a: unpacked.append(1) or read_chunk(*a))
    late = list(open_reader(tmp_path / "walk.mcap").messages({"late"}))
    assert len(late) == 30
    assert len(unpacked) <= 2


@pytest.mark.parametrize(
    ("encoding", "told"),
    [("ros1", "ROS 1 bag that it was made of"), ("protobuf", "encoded as protobuf.*write them as ROS 2")],
)
def test_a_recording_of_another_encoding_is_refused_with_what_to_convert(
    tmp_path: Path, encoding: str, told: str
) -> None:
    file = without_chunks(tmp_path / "take.mcap", realsense(), encoding)
    with pytest.raises(RecordingError, match=f"{FRAMES} messages of /camera/.*{told}"):
        open_source(str(file), SourceOptions())
    with pytest.raises(RecordingError, match=told):
        info(file)


def without_chunks(file: Path, messages: list[Message], encoding: str = "cdr") -> Path:
    """Write the messages as ROS 2's preset `fastwrite` does."""
    written = McapWriter(str(file), use_chunking=False)
    written.start("ros2", "another program")
    channels: dict[str, int] = {}
    for message in messages:
        if message.topic not in channels:
            schema = written.register_schema(message.type_name, "ros2msg", b"")
            channels[message.topic] = written.register_channel(f"/{message.topic}", encoding, schema)
        logged = message.stamp + 80_000_000
        written.add_message(channels[message.topic], logged, bytes(message.payload), logged)
    written.finish()
    return file


def test_messages_without_chunks_come_in_the_order_of_time(tmp_path: Path) -> None:
    walk = walk_of(90, 24, 32)
    file = without_chunks(tmp_path / "walk.mcap", sorted(walk, key=lambda message: message.topic))
    reader = open_reader(file)
    assert [message.stamp for message in reader.messages()] == [message.stamp for message in walk]
    assert reader.complete
    assert reader.behind == 0
    assert len(frames_of(file)[0]) == 90


def test_messages_without_chunks_whose_clock_was_set_back_come_as_they_lie(tmp_path: Path) -> None:
    walk = walk_of(90, 24, 32)
    reader = open_reader(without_chunks(tmp_path / "walk.mcap", [*walk[180:], *walk[:180]]))
    assert next(iter(reader.messages())).stamp == walk[180].stamp


def test_of_a_damaged_recording_written_topic_after_topic_the_rest_comes_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writer, "_CHUNK_BYTES", 1 << 20)
    walk, file = walk_of(90, 120, 160), tmp_path / "walk.mcap"
    with RecordingWriter(file, compression="none") as written:
        for message in sorted(walk, key=lambda message: message.topic):
            written.write(message)
    damaged = bytearray(file.read_bytes())
    damaged[len(damaged) // 2] ^= 0xFF
    file.write_bytes(damaged)
    reader = open_reader(file)
    stamps = [message.stamp for message in reader.messages()]
    assert stamps == sorted(stamps)
    assert 0.7 * len(walk) < len(stamps) < len(walk)
    (told,) = reader.damage
    assert f"missing: {len(walk) - len(stamps)} of /camera/" in told


def test_a_recording_whose_clock_was_set_back_is_played_as_it_was_recorded(tmp_path: Path) -> None:
    walk = walk_of(120, 120, 160)
    shuffled = [*walk[180:], *walk[:180]]
    reader = open_reader(record(tmp_path / "bag", shuffled))
    played = list(reader.messages())
    assert played[0].stamp == walk[180].stamp
    assert reader.behind == 0


def test_the_last_messages_before_the_clock_was_set_back_are_played_before_those_behind_it(tmp_path: Path) -> None:
    walk = walk_of(90, 24, 32)
    back = [restamp(message, Stamp(message.stamp - 60_000_000_000)) for message in walk[135:]]
    recorded = [*walk[:135], *back]
    bag = record(tmp_path / "bag", recorded)
    played = [(message.topic, message.stamp) for message in open_reader(bag).messages()]
    assert played == [(message.topic, message.stamp) for message in recorded]


def test_topics_one_after_the_other_whose_log_times_hide_it_are_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    walk = sorted(walk_of(90, 24, 32), key=lambda message: message.topic)
    with RecordingWriter(tmp_path / "written.mcap") as writer:
        for number, message in enumerate(walk):
            writer.write(message, at=Stamp(BEGIN + number))
    list(open_source(str(tmp_path / "written.mcap"), SourceOptions()).messages())
    (told,) = [record.getMessage() for record in caplog.records if record.levelname == "WARNING"]
    assert "written one after the other" in told
    assert "stamp as its log time" in told


def test_messages_too_far_out_of_order_are_refused_with_the_command_that_sorts_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mcap_order, "_MOST_HELD_BYTES", 1 << 20)
    bag = record(tmp_path / "bag", sorted(walk_of(90, 120, 160), key=lambda message: message.topic))
    with pytest.raises(RecordingError, match=r"out of the order of time.*mcap sort"):
        open_source(str(bag), SourceOptions())


def rewrite(bag: Path, old: str, new: str) -> None:
    metadata = bag / "metadata.yaml"
    told = metadata.read_text()
    assert old in told
    metadata.write_text(told.replace(old, new))


def cut(bag: Path, size: int) -> None:
    (database,) = bag.glob("*.db3")
    os.truncate(database, min(size, database.stat().st_size // 2))


BREAK: dict[str, Callable[[Path], object]] = {
    "of a later version": lambda bag: rewrite(bag, "version: 9", "version: 99"),
    "of an unknown compression": lambda bag: rewrite(
        bag, "compression_format: ''", "compression_format: lz4\n  compression_mode: message"
    ),
    "whose metadata is no YAML": lambda bag: (bag / "metadata.yaml").write_bytes(b"\xff{"),
    "whose database is another": lambda bag: next(bag.glob("*.db3")).rename(bag / "other.db3"),
    "cut in its first page": lambda bag: cut(bag, 60),
    "cut in the middle": lambda bag: cut(bag, 10**9),
    "emptied": lambda bag: cut(bag, 0),
}


@pytest.mark.parametrize("kind", BREAK)
def test_a_database_bag_that_cannot_be_read_is_a_recording_error(tmp_path: Path, kind: str) -> None:
    bag = record(tmp_path / "bag", realsense(), StoragePlugin.SQLITE3)
    BREAK[kind](bag)
    with pytest.raises(RecordingError, match="bag"):
        open_reader(bag).counts()
    with pytest.raises(RecordingError, match="bag"):
        list(open_reader(bag).messages())


def test_named_topics_win_and_unknown_ones_are_refused(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", realsense())
    options = SourceOptions(
        topics_from=(("color", "/camera/infra1/image_rect_raw"), ("truth", "/vicon/helmet/pose")), topics=Topics("k2")
    )
    messages = list(open_source(str(bag), options).messages())
    assert {message.topic for message in messages} == {
        "k2/color/image_raw",
        "k2/depth/image_raw",
        "k2/color/camera_info",
        "truth/helmet/pose",
    }
    with pytest.raises(ConfigError, match="/nothing"):
        open_source(str(bag), SourceOptions(topics_from=(("depth", "/nothing"),)))
    with pytest.raises(ConfigError, match="sound"):
        open_source(str(bag), SourceOptions(topics_from=(("sound", "/vicon/helmet/pose"),)))


def test_the_topics_that_are_taken_are_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    options = SourceOptions(topics_from=(("truth", "/vicon/helmet/pose"),))
    open_source(str(record(tmp_path / "bag", realsense())), options)
    (told,) = [record.getMessage() for record in caplog.records if "colour" in record.getMessage()]
    assert told.endswith(
        "bag: colour /camera/color/image_raw, depth /camera/aligned_depth_to_color/image_raw, "
        "calibration /camera/color/camera_info, truth /vicon/helmet/pose"
    )


@pytest.mark.parametrize(
    ("topic", "key"),
    [
        ("vicon/hat/pose", "truth/hat/pose"),
        ("helmet", "truth/helmet/pose"),
        ("pose", "truth/body/pose"),
        ("truth/rig two/pose", "truth/rig_two/pose"),
    ],
)
def test_a_named_truth_is_a_body_of_its_name(tmp_path: Path, topic: str, key: str) -> None:
    poses = [encode_pose(topic, Stamp(BEGIN + i * PERIOD_NS), np.eye(4), "vicon") for i in range(FRAMES)]
    bag = record(tmp_path / "bag", [*realsense(), *poses])
    messages = open_source(str(bag), SourceOptions(topics_from=(("truth", f"/{topic}"),))).messages()
    assert [message.topic for message in messages].count(key) == FRAMES


@pytest.mark.parametrize("topic", ["/nothing/pose", "/camera/color/camera_info"])
def test_a_named_truth_that_holds_no_poses_is_refused_with_those_that_do(tmp_path: Path, topic: str) -> None:
    bag = record(tmp_path / "bag", realsense())
    with pytest.raises(ConfigError, match=r"--topic truth=.*/vicon/helmet/pose"):
        open_source(str(bag), SourceOptions(topics_from=(("truth", topic),)))


def test_truth_that_begins_late_is_played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay, "_PEEK_BYTES", sum(len(message.payload) for message in realsense()))
    late = Stamp(BEGIN + (FRAMES - 1) * PERIOD_NS + 9_000_000)
    bag = record(
        tmp_path / "bag", [*realsense(), *(encode_pose(t, late, np.eye(4), "m") for t in ("truth/a/pose", "b"))]
    )
    assert "truth/a/pose" in {message.topic for message in open_source(str(bag), SourceOptions()).messages()}
    named = open_source(str(bag), SourceOptions(topics_from=(("truth", "b"),)))
    assert "truth/b/pose" in {message.topic for message in named.messages()}


def test_bodies_of_any_name_have_a_key_that_can_be_published(tmp_path: Path) -> None:
    names = ["rig 2*", "a/b", "Körper", "x" * 100, ""]
    stamp = Stamp(BEGIN + PERIOD_NS)
    poses = [encode_pose(f"truth/{name}/pose", stamp, np.eye(4), "mocap") for name in names]
    bag = record(tmp_path / "bag", [*realsense(), *poses])
    played = {message.topic for message in open_source(str(bag), SourceOptions()).messages()}
    keys = {topic for topic in played if topic.startswith("truth/")}
    assert keys == {
        "truth/rig_2_/pose",
        "truth/a_b/pose",
        "truth/K_rper/pose",
        f"truth/{'x' * 64}/pose",
        "truth/body/pose",
    }


@pytest.mark.parametrize(
    ("folder", "name", "info", "own", "is_told"),
    [
        ("camera/depth", "image_rect_raw", "camera_info", Camera(64, 48, 38.0, 38.0, 32.0, 24.0), True),
        ("camera/depth", "image/compressedDepth", "camera_info", Camera(64, 48, 38.0, 38.0, 32.0, 24.0), True),
        ("device/Depth_0", "image/data", "info/camera_info", Camera(64, 48, 38.0, 38.0, 32.0, 24.0), True),
        ("camera/depth", "image_rect_raw", "camera_info", Camera(64, 48, 50.5, 50.5, 31.0, 24.0), False),
        ("camera/depth_registered", "image", "camera_info", Camera(64, 48, 38.0, 38.0, 32.0, 24.0), False),
    ],
)
def test_depth_with_another_calibration_than_colours_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, folder: str, name: str, info: str, own: Camera, is_told: bool
) -> None:
    """Of a driver that was not asked to register depth, which here has colour's size by chance."""
    stamps = [Stamp(BEGIN + i * PERIOD_NS) for i in range(FRAMES)]
    topic, calibration = f"{folder}/{name}", f"{folder}/{info}"
    messages = [encode_depth(topic, stamp, kinect_depth()) for stamp in stamps]
    messages += [encode_camera_info(calibration, stamp, own) for stamp in stamps]
    messages += [message for message in realsense() if message.topic.startswith("camera/color/")]
    for named in ((), (("depth", topic),)):
        caplog.clear()
        open_source(str(record(tmp_path / f"bag{len(named)}", messages)), SourceOptions(topics_from=named))
        assert ("its pixels lie up to" in caplog.text) == is_told


@pytest.mark.parametrize(
    ("info", "is_told"),
    [
        ("camera/depth/camera_info", True),
        ("camera/infra1/camera_info", True),
        ("camera/aligned_depth_to_color/camera_info", False),
        ("camera/rgb/camera_info", False),
        ("calibration", False),
    ],
)
def test_a_calibration_that_is_another_cameras_by_its_name_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, info: str, is_told: bool
) -> None:
    """It is taken where colour's was not recorded and the sizes agree."""
    messages = [message for message in realsense() if message.type_name != cdr.CAMERA_INFO]
    bag = record(tmp_path / "bag", [*messages, encode_camera_info(info, Stamp(BEGIN), CAMERA)])
    open_source(str(bag), SourceOptions())
    assert (f"calibration /{info} is by its name not that of colour" in caplog.text) == is_told
    caplog.clear()
    (tmp_path / "own.yaml").write_text(calibration_text(Calibration(CAMERA)))
    open_source(str(bag), SourceOptions(camera=tmp_path / "own.yaml"))
    assert not caplog.text


def test_depth_in_millimetres_as_floats_is_refused_with_the_remedy(tmp_path: Path) -> None:
    def float_millimetres(topic: str, stamp: Stamp, depth: np.ndarray) -> Message:
        return images._encode_image(topic, stamp, depth.astype(np.float32), "32FC1", "camera")

    bag = record(tmp_path / "bag", realsense(depth=float_millimetres))
    with pytest.raises(RecordingError, match=r"aligned_depth.*looks like millimetres.*divide.*16UC1"):
        open_source(str(bag), SourceOptions())


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    without_depth = [message for message in realsense() if "depth" not in message.topic]
    with pytest.raises(RecordingError, match=r"no depth images.*camera/color/image_raw"):
        open_source(str(record(tmp_path / "a", without_depth)), SourceOptions())
    without_info = [message for message in realsense() if "camera_info" not in message.topic]
    bag = record(tmp_path / "b", without_info)
    with pytest.raises(RecordingError, match=r"no camera_info.*--camera"):
        open_source(str(bag), SourceOptions())
    calibration = tmp_path / "camera.yaml"
    calibration.write_text(
        "image_width: 64\nimage_height: 48\ncamera_matrix: {data: [50, 0, 31, 0, 51, 23, 0, 0, 1]}\n"
        "distortion_model: plumb_bob\ndistortion_coefficients: {data: [0.1, 0, 0, 0, 0]}\n"
    )
    frames, assembler = frames_of(bag, SourceOptions(camera=calibration))
    assert len(frames) == FRAMES
    assert assembler.camera == CAMERA


def fisheye(message: Message) -> Message:
    """The calibration with a lens model that is not supported."""
    decoded = cdr.deserialise(message, cdr.CAMERA_INFO)
    told = replace(decoded, distortion_model="equidistant", d=np.array([0.1, 0.2, 0.3, 0.4]))
    return cdr.serialise(message.topic, cdr.CAMERA_INFO, message.stamp, told)


def test_a_calibration_that_cannot_be_used_is_refused_with_its_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    messages = [fisheye(m) if m.topic == "camera/color/camera_info" else m for m in realsense()]
    bag = record(tmp_path / "bag", messages)
    with pytest.raises(RecordingError, match=r"equidistant.*--camera"):
        open_source(str(bag), SourceOptions())
    info(bag)
    told = capsys.readouterr().out
    assert "colour /camera/color/image_raw, depth" in told
    assert "equidistant" in told
    assert "complete" in told
    calibration = tmp_path / "camera.yaml"
    calibration.write_text(
        "image_width: 64\nimage_height: 48\ncamera_matrix: {data: [50, 0, 31, 0, 51, 23, 0, 0, 1]}\n"
    )
    frames, _ = frames_of(bag, SourceOptions(camera=calibration))
    assert len(frames) == FRAMES


def test_a_named_calibration_of_another_size_is_refused(tmp_path: Path) -> None:
    bag = record(tmp_path / "bag", realsense())
    with pytest.raises(RecordingError, match=r"32 x 24.*64 x 48"):
        open_source(str(bag), SourceOptions(topics_from=(("camera_info", "/camera/depth/camera_info"),)))


def test_rectified_colour_gets_the_rectified_camera(tmp_path: Path) -> None:
    messages = []
    for i in range(FRAMES):
        stamp = Stamp(BEGIN + i * PERIOD_NS)
        messages += [
            encode_color("k/rgb/image_rect_color", stamp, textured(seed=i)),
            encode_depth("k/depth_registered/image_rect", stamp, kinect_depth(seed=i)),
            encode_camera_info("k/rgb/camera_info", stamp, CAMERA),
        ]
    _, assembler = frames_of(record(tmp_path / "bag", messages))
    assert assembler.camera == Camera(64, 48, 50.0, 51.0, 31.0, 23.0)


def test_big_endian_cdr_is_read(tmp_path: Path) -> None:
    """Some embedded writers use the other byte order."""
    big = [
        Message(
            message.topic,
            message.type_name,
            message.stamp,
            bytes(
                ROS2.serialize_cdr(cdr.deserialise(message, message.type_name), message.type_name, little_endian=False)
            ),
        )
        for message in realsense(jpeg)
    ]
    frames, _ = frames_of(record(tmp_path / "bag", big))
    assert len(frames) == FRAMES
    assert cv2.PSNR(frames[0][0], textured(seed=0)) > 30
