"""Status, loop candidates, acknowledgements and the end of a source: messages of texts and whole numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from odom.errors import WireError
from odom.frame import Stamp
from odom.wire.codec import cdr
from odom.wire.message import Message


@dataclass(frozen=True)
class Status:
    """One line of diagnostics: `level` 0 OK, 1 WARN, 2 ERROR, 3 STALE; `values` are texts in their order."""

    stamp: Stamp
    name: str
    level: int
    message: str
    values: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Loop:
    """What became of one loop candidate: the two frames, inliers, decision and reason."""

    stamp: Stamp
    candidate_stamp: Stamp
    inliers: int
    accepted: bool
    reason: str


def encode_status(topic: str, *status: Status) -> Message:
    """Return the diagnostics message of one or more statuses; its stamp is the first one's."""
    if not status:
        raise WireError("a diagnostics message needs at least one status")
    entries = []
    for entry in status:
        values = [
            cdr.build("diagnostic_msgs/msg/KeyValue", key=str(key), value=str(value))
            for key, value in entry.values.items()
        ]
        entries.append(
            cdr.build(
                "diagnostic_msgs/msg/DiagnosticStatus",
                level=entry.level,
                name=entry.name,
                message=entry.message,
                hardware_id=topic.split("/")[0],
                values=values,
            )
        )
    return cdr.encode(topic, cdr.DIAGNOSTICS, status[0].stamp, "", status=entries)


def decode_status(message: Message) -> tuple[Status, ...]:
    """Return the statuses of a diagnostics message; raises WireError on malformed bytes."""
    decoded = cdr.deserialise(message, cdr.DIAGNOSTICS)
    stamp = cdr.stamp_of(message.type_name, message.payload) or message.stamp
    return tuple(
        Status(stamp, entry.name, int(entry.level), entry.message, {kv.key: kv.value for kv in entry.values})
        for entry in decoded.status
    )


def encode_loop(topic: str, loop: Loop) -> Message:
    """Return the message of one loop candidate."""
    values = {
        "stamp": str(loop.stamp),
        "candidate_stamp": str(loop.candidate_stamp),
        "inliers": str(loop.inliers),
        "accepted": "true" if loop.accepted else "false",
    }
    return encode_status(topic, Status(loop.stamp, "loop", 0, loop.reason, values))


def decode_loop(message: Message) -> Loop:
    """Return the loop candidate of a message; raises WireError when it is none."""
    statuses = decode_status(message)
    if not statuses:
        raise WireError(f"{message.topic}: diagnostics without a status")
    values = statuses[0].values
    try:
        stamps = Stamp(int(values["stamp"])), Stamp(int(values["candidate_stamp"]))
        return Loop(*stamps, int(values["inliers"]), values["accepted"] == "true", statuses[0].message)
    except (KeyError, ValueError) as error:
        raise WireError(f"{message.topic}: no loop candidate in {dict(values)}: {error!r}") from error


def encode_text(topic: str, stamp: Stamp, text: str) -> Message:
    """Return std_msgs/String, whose bytes hold no stamp; `stamp` is that of the returned message."""
    return cdr.serialise(topic, cdr.STRING, stamp, cdr.build(cdr.STRING, data=text))


def decode_text(message: Message) -> str:
    """Return the text of std_msgs/String; raises WireError on malformed bytes."""
    return str(cdr.deserialise(message, cdr.STRING).data)


def encode_numbers(topic: str, stamp: Stamp, numbers: Sequence[int]) -> Message:
    """Return std_msgs/UInt64MultiArray of whole numbers in [0, 2**64), whose bytes hold no stamp."""
    if not all(0 <= number < 2**64 for number in numbers):
        raise WireError(f"{topic}: {numbers} do not fit unsigned 64 bit")
    layout = cdr.build("std_msgs/msg/MultiArrayLayout", dim=[], data_offset=0)
    message = cdr.build(cdr.NUMBERS, layout=layout, data=np.array(numbers, dtype=np.uint64))
    return cdr.serialise(topic, cdr.NUMBERS, stamp, message)


def decode_numbers(message: Message) -> tuple[int, ...]:
    """Return the numbers of std_msgs/UInt64MultiArray; raises WireError on malformed bytes."""
    return tuple(int(number) for number in cdr.deserialise(message, cdr.NUMBERS).data)
