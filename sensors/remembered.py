"""Calibrations that runs have found, remembered for the device they were found with."""

import os
import re
from pathlib import Path

from odom.errors import ConfigError

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
"""Serial numbers that can name a file."""


def remembered_file(serial: str) -> Path:
    """Return where the calibration of the device with a serial number is remembered, whether or not there is one.

    In the user's data folder ($XDG_DATA_HOME, or ~/.local/share). Raises ConfigError for a serial number that cannot
    name a file.
    """
    if not _NAME.fullmatch(serial):
        raise ConfigError(f"nothing can be remembered for the serial number {serial!r}: use --camera FILE")
    own = os.environ.get("XDG_DATA_HOME", "")
    data = Path(own) if Path(own).is_absolute() else Path.home() / ".local" / "share"
    return data / "odom" / "cameras" / f"{serial}.yaml"


def remember(serial: str, text: str) -> Path:
    """Write a calibration's file for a device, whole or not at all; return where it is. Raises OSError."""
    path = remembered_file(serial)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(f".{os.getpid()}.part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
    return path
