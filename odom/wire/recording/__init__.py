"""MCAP recordings: the bytes of the wire, kept."""

from pathlib import Path

from odom.errors import RecordingError
from odom.wire.recording.bag import ROS1_SUFFIX, RosbagsReader
from odom.wire.recording.bag import BagReader as BagReader
from odom.wire.recording.bag_folder import DATABASE_SUFFIX, METADATA, UNPACK_FIRST, is_packed
from odom.wire.recording.part_file import PART
from odom.wire.recording.reader import RecordedStream as RecordedStream
from odom.wire.recording.reader import RecordingReader as RecordingReader
from odom.wire.recording.recovery import recover as recover
from odom.wire.recording.stream_selection import STREAM_ROLES as STREAM_ROLES
from odom.wire.recording.stream_selection import SelectedStreams as SelectedStreams
from odom.wire.recording.stream_selection import of_another_camera as of_another_camera
from odom.wire.recording.stream_selection import select_streams as select_streams
from odom.wire.recording.stream_selection import unregistered as unregistered
from odom.wire.recording.writer import RecordingWriter as RecordingWriter


def is_recording(path: Path) -> bool:
    """Return whether `path` is that of a recording: an .mcap, .db3 or .bag file, or the folder of a ROS 2 bag.

    An `.mcap.part`, left by a recorder that was killed, is one too.
    """
    if path.is_dir():
        return (path / METADATA).is_file() or any(path.glob(f"[!.]*{DATABASE_SUFFIX}"))
    return Path(path.name.removesuffix(PART)).suffix.lower() in (".mcap", DATABASE_SUFFIX, ROS1_SUFFIX)


def open_reader(path: Path) -> RecordingReader:
    """Return the reader of an .mcap file or a ROS bag, file or folder; raises RecordingError when it is neither."""
    if path.is_dir():
        return BagReader(path)
    if is_packed(path):
        raise RecordingError(f"{path} {UNPACK_FIRST}")
    return RosbagsReader(path) if path.suffix.lower() in (DATABASE_SUFFIX, ROS1_SUFFIX) else RecordingReader(path)
