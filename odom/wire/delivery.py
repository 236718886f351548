"""What travels beside a message: an attachment of 33 bytes, counted and timed by the sender.

It holds flags, the sender's epoch (its start, random), its serial number over all keys, the sequence number on the key,
and the wall time of sending. A foreign message without one is taken as it is; its type is then told by its name.
"""

import time
from dataclasses import dataclass
from struct import Struct

import zenoh

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.codec import cdr
from odom.wire.message import Message

_ATTACHMENT = Struct("<BQQQq")
_LOSSLESS = 1
_ENCODING = "application/cdr"

_TYPES: tuple[tuple[str, str], ...] = (
    ("/compressed", cdr.COMPRESSED_IMAGE),
    ("/compressedDepth", cdr.COMPRESSED_IMAGE),
    ("/image_raw", cdr.IMAGE),
    ("/camera_info", cdr.CAMERA_INFO),
    ("/pose", cdr.POSE),
    ("/odom", cdr.ODOMETRY),
    ("/path", cdr.PATH),
    ("/status", cdr.DIAGNOSTICS),
    ("/device", cdr.DIAGNOSTICS),
    ("/loops", cdr.DIAGNOSTICS),
    ("/features", cdr.POINT_CLOUD),
    ("/landmarks", cdr.POINT_CLOUD),
    ("/keyframes", cdr.POINT_CLOUD),
    ("/end", cdr.STRING),
    ("tf", cdr.TRANSFORMS),
)


@dataclass(frozen=True)
class Attachment:
    """How a sender counts and times a message; `lossless` when it waits for acknowledgement."""

    lossless: bool
    epoch: int
    serial: int
    sequence: int
    sent: Stamp

    def pack(self) -> bytes:
        """Return the 33 bytes."""
        return _ATTACHMENT.pack(self.lossless * _LOSSLESS, self.epoch, self.serial, self.sequence, self.sent)


@dataclass(frozen=True)
class Delivery:
    """A message as it arrived. `epoch`, `serial`, `sequence` (from 0) and `sent` are None from a foreign sender."""

    message: Message
    lossless: bool = False
    epoch: int | None = None
    serial: int | None = None
    sequence: int | None = None
    sent: Stamp | None = None


def encoding_of(type_name: str) -> str:
    """Return the Zenoh encoding that names the message type."""
    return f"{_ENCODING};{type_name}"


def attachment_of(sample: zenoh.Sample) -> Attachment | None:
    """Return the attachment of a sample, None when there is none of ours."""
    if sample.attachment is None or len(sample.attachment) != _ATTACHMENT.size:
        return None
    flags, epoch, serial, sequence, sent = _ATTACHMENT.unpack(sample.attachment.to_bytes())
    return Attachment(bool(flags & _LOSSLESS), epoch, serial, sequence, Stamp(sent))


def delivery_of(topic: str, attachment: Attachment | None, sample: zenoh.Sample) -> Delivery:
    """Return the sample as a message with its stamp; raises WireError when it has no known type or no stamp."""
    payload = sample.payload.to_bytes()
    encoding, _, name = str(sample.encoding).partition(";")
    type_name = name if encoding == _ENCODING and name else _type_of(topic)
    stamp = cdr.stamp_of(type_name, payload)
    if stamp is None:
        stamp = Stamp(time.time_ns()) if attachment is None else attachment.sent
    message = Message(topic, type_name, stamp, payload)
    if attachment is None:
        return Delivery(message)
    return Delivery(
        message, attachment.lossless, attachment.epoch, attachment.serial, attachment.sequence, attachment.sent
    )


def _type_of(topic: str) -> str:
    for suffix, type_name in _TYPES:
        if topic.endswith(suffix):
            return type_name
    raise WireError(f"{topic}: neither its encoding nor its name tells the message type")
