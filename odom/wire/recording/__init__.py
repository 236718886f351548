"""MCAP recordings: the bytes of the wire, kept."""

from pathlib import Path

from odom.wire.recording.bag import BagReader
from odom.wire.recording.reader import RecordingReader, Stream, recover
from odom.wire.recording.roles import ROLES, Roles, assign_roles
from odom.wire.recording.writer import RecordingWriter

__all__ = [
    "ROLES",
    "BagReader",
    "RecordingReader",
    "RecordingWriter",
    "Roles",
    "Stream",
    "assign_roles",
    "open_reader",
    "recover",
]


def open_reader(path: Path) -> RecordingReader:
    """Return the reader of an .mcap file or of a ROS 2 bag folder; raises RecordingError when it is neither."""
    return BagReader(path) if path.is_dir() else RecordingReader(path)
