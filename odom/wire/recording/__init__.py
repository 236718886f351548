"""MCAP recordings: the bytes of the wire, kept."""

from odom.wire.recording.reader import RecordingReader, Stream, recover
from odom.wire.recording.roles import ROLES, Roles, assign_roles
from odom.wire.recording.writer import RecordingWriter

__all__ = ["ROLES", "RecordingReader", "RecordingWriter", "Roles", "Stream", "assign_roles", "recover"]
