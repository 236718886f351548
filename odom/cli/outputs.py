"""Where a recording may be written: not onto what is read for it."""

import os
from pathlib import Path

from odom.errors import ConfigError, RecordingError


def check_not_read(source: str, output: Path) -> None:
    """Raise ConfigError when `output` is the recording SOURCE, or lies in the folder that is read."""
    read = Path(source.removeprefix("kinect:"))
    if not (output.exists() and read.exists()):
        return
    if output.resolve().is_relative_to(read.resolve()) if read.is_dir() else output.samefile(read):
        raise ConfigError(f"{output} is what would be read: give another name for the recording")


def check_recording(source: str, output: Path, overwrite: bool) -> None:
    """Raise ConfigError when `odom run SOURCE` may not record to `output`, whose name may hold `{time}`."""
    from odom.wire.recording.part_file import check_free

    check_not_read(source, output)
    try:
        check_free(output, overwrite)
    except RecordingError as error:
        raise ConfigError(f"--record: {error}") from error
    folder = next(parent for parent in output.absolute().parents if parent.exists())
    if not (folder.is_dir() and os.access(folder, os.W_OK)):
        raise ConfigError(f"--record {output}: nothing can be written in {folder}; give another place")
