"""Mends a damaged MCAP recording: every message that is whole goes into a sound file."""

import os
from collections.abc import Callable
from itertools import chain
from pathlib import Path

from mcap.writer import CompressionType, Writer

from odom.errors import RecordingError
from odom.wire.recording.mcap_file import McapFile
from odom.wire.recording.part_file import PART, TakenError

_CHUNK_BYTES = 1 << 20
"""Size of the chunks of the mended file. Larger: a viewer reads more for one message; smaller: a larger index."""


def recover(
    source: Path,
    target: Path,
    overwrite: bool = False,
    progress: Callable[[int], None] = lambda messages: None,
    stopped: Callable[[], bool] = lambda: False,
) -> tuple[int, tuple[str, ...]]:
    """Copy every whole message of a damaged recording into a sound one, with its own schemas and channels.

    `progress` is called with the number of messages copied so far; once `stopped` returns True, no more are copied.
    Returns the number of messages and what was wrong. Raises RecordingError when nothing can be saved, TakenError when
    `target` exists and may not be replaced; it is replaced only once all that can be saved is written.
    """
    damaged, count = McapFile(source), 0
    if target.exists() and source.exists() and target.samefile(source):
        raise TakenError(f"{target} is the recording that is to be mended: choose another name")
    if target.exists() and not overwrite:
        raise TakenError(f"{target} exists already: choose another name or replace it with --overwrite")
    messages = damaged.messages()
    first = next(messages, None)
    if first is None:
        raise RecordingError(f"{source}: no message can be saved ({'; '.join(damaged.damage) or 'there is none'})")
    growing = target.with_name(f"{target.name}.{os.getpid()}{PART}")
    try:
        with growing.open("xb") as file:
            writer = Writer(file, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD)
            header = damaged.header
            writer.start(profile=header.profile if header else "ros2", library=header.library if header else "")
            schemas: dict[int, int] = {}
            channels: dict[int, int] = {}
            for channel, message in chain([first], messages):
                if channel.id not in channels:
                    schema = damaged.schemas.get(channel.schema_id)
                    if schema is not None and schema.id not in schemas:
                        schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
                    channels[channel.id] = writer.register_channel(
                        channel.topic, channel.message_encoding, schemas.get(channel.schema_id, 0), channel.metadata
                    )
                writer.add_message(
                    channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
                )
                count += 1
                progress(count)
                if stopped():
                    break
            for entry in damaged.metadata:
                writer.add_metadata(entry.name, entry.metadata)
            writer.finish()  # type: ignore[no-untyped-call]  # mcap gives no type
        if stopped() and target.exists():
            raise RecordingError(f"interrupted: {target} stays as it was")
        growing.replace(target)
    except OSError as error:
        raise RecordingError(f"{target} cannot be written: {error.strerror}") from error
    finally:
        growing.unlink(missing_ok=True)
    return count, tuple(damaged.damage)
