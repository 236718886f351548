"""What travels beside a message: an attachment of 33 bytes, in which the sender counts and times it."""

import time
from struct import Struct
from typing import NamedTuple

import zenoh

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.codec import stamp_of
from odom.wire.message import Message
from odom.wire.topics import type_of

_LAYOUT = Struct("<BQQQq")
_ENCODING = "application/cdr"


class Attachment(NamedTuple):
    """How a sender counts and times a message.

    `lossless`: it waits for acknowledgement; `epoch`: the sender itself, a random number; `serial`: number over all its
    keys, `sequence`: on this key, both from 0; `sent`: wall time of sending.
    """

    lossless: bool
    epoch: int
    serial: int
    sequence: int
    sent: Stamp

    def pack(self) -> bytes:
        """Return the 33 bytes."""
        return _LAYOUT.pack(*self)


class Delivery(NamedTuple):
    """A message as it arrived, with the fields of its `Attachment`, which are None from a foreign sender."""

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
    """Return the attachment of a sample, None when it has none of this project's."""
    if sample.attachment is None or len(sample.attachment) != _LAYOUT.size:
        return None
    flags, epoch, serial, sequence, sent = _LAYOUT.unpack(sample.attachment.to_bytes())
    return Attachment(bool(flags & 1), epoch, serial, sequence, Stamp(sent))


def delivery_of(topic: str, attachment: Attachment | None, sample: zenoh.Sample) -> Delivery:
    """Return the sample as a message with its stamp; the type is named by its key, else by its encoding.

    Raises WireError when it has no known type or another than its key, or its bytes end before the stamp.
    """
    payload = sample.payload.to_bytes()
    encoding, _, name = str(sample.encoding).partition(";")
    named = name if encoding == _ENCODING and name else None
    type_name = type_of(topic) or named
    if type_name is None:
        raise WireError(f"{topic}: neither its encoding nor its name says which message type it has")
    if named not in (None, type_name):
        raise WireError(f"{topic}: messages of this key are {type_name}, not {named}")
    stamp = stamp_of(type_name, payload)
    if stamp is None:
        stamp = Stamp(time.time_ns()) if attachment is None else attachment.sent
    return Delivery(Message(topic, type_name, stamp, payload), *(attachment or ()))
