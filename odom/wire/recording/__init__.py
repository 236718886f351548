"""MCAP recordings: the bytes of the wire, kept."""

from pathlib import Path

from odom.wire.recording.bag import BagReader as BagReader
from odom.wire.recording.reader import RecordedStream as RecordedStream
from odom.wire.recording.reader import RecordingReader as RecordingReader
from odom.wire.recording.recovery import recover as recover
from odom.wire.recording.stream_selection import STREAM_ROLES as STREAM_ROLES
from odom.wire.recording.stream_selection import SelectedStreams as SelectedStreams
from odom.wire.recording.stream_selection import select_streams as select_streams
from odom.wire.recording.writer import RecordingWriter as RecordingWriter


def open_reader(path: Path) -> RecordingReader:
    """Return the reader of an .mcap file or of a ROS 2 bag folder; raises RecordingError when it is neither."""
    return BagReader(path) if path.is_dir() else RecordingReader(path)
