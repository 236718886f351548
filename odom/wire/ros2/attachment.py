"""What travels beside a message between ROS 2 nodes on Zenoh: 33 bytes that number and time it."""

from struct import Struct
from typing import NamedTuple

from odom.frame import Stamp

GID_BYTES = 16
"""Bytes that name a publisher in ROS 2, of every middleware."""
_LAYOUT = Struct(f"<qqB{GID_BYTES}s")


class RosAttachment(NamedTuple):
    """`sequence` counts a publisher's messages from 1, `sent` is the wall time in ns, `gid` names the publisher."""

    sequence: int
    sent: Stamp
    gid: bytes

    def pack(self) -> bytes:
        """Return the 33 bytes, as Zenoh's serialiser writes two int64 and an array of 16 bytes."""
        return _LAYOUT.pack(self.sequence, self.sent, GID_BYTES, self.gid)


def ros_attachment_of(data: bytes) -> RosAttachment | None:
    """Return what the bytes beside a message say, None when they are not of this form."""
    if len(data) != _LAYOUT.size:
        return None
    sequence, sent, length, gid = _LAYOUT.unpack(data)
    return RosAttachment(sequence, Stamp(sent), gid) if length == GID_BYTES else None


def gid_of(token: str) -> bytes:
    """Return the 16 bytes that stand for an endpoint: the XXH3 hash of its token, lower half first."""
    import xxhash

    return xxhash.xxh3_128_intdigest(token.encode()).to_bytes(GID_BYTES, "little")
