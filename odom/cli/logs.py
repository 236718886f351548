"""One format of log lines on stderr for every process: text for people, `--log-json` for machines."""

import json
import logging
import os
import sys
import time
from collections.abc import Sequence
from enum import StrEnum
from typing import TextIO

from odom.service import log_form

LEVEL_ENVIRONMENT = "ODOM_LOG_LEVEL"


class Level(StrEnum):
    """How much is logged."""

    DEBUG = "DEBUG"
    INFO = "INFO"
    WARNING = "WARNING"
    ERROR = "ERROR"


class _TextFormatter(logging.Formatter):
    def __init__(self) -> None:
        super().__init__("%(asctime)s.%(msecs)03dZ %(levelname)-7s %(name)s: %(message)s", "%Y-%m-%dT%H:%M:%S")
        self.converter = time.gmtime


class _JsonFormatter(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        """Return one JSON object; the time is in seconds since the epoch."""
        fields = {
            "time": round(record.created, 6),
            "level": record.levelname,
            "logger": record.name,
            "process": record.process,
            "message": record.getMessage(),
        }
        if record.exc_info:
            fields["exception"] = self.formatException(record.exc_info)
        return json.dumps(fields)


class _Handler(logging.StreamHandler[TextIO]):
    """Writes to the stderr of the moment, which a progress bar replaces, or to where `lead_to` says."""

    outside: TextIO | None = None

    @property
    def stream(self) -> TextIO:
        """The stream of the moment."""
        return self.outside or sys.stderr

    @stream.setter
    def stream(self, value: TextIO) -> None:
        return


def lead_to(stream: TextIO) -> None:
    """Let log lines go to `stream` from now on."""
    _Handler.outside = stream


def is_json_asked(arguments: Sequence[str]) -> bool:
    """Return whether a command line, or the environment, asks for JSON."""
    return "--log-json" in arguments or log_form.as_json()


def configure(level: Level, as_json: bool) -> None:
    """Put log lines on stderr, and into the environment so that children log alike."""
    os.environ[LEVEL_ENVIRONMENT] = level.value
    os.environ[log_form.JSON_ENVIRONMENT] = "1" if as_json else "0"
    handler = _Handler()
    handler.setFormatter(_JsonFormatter() if as_json else _TextFormatter())
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level.value)
    logging.captureWarnings(as_json)
    for chatty in ("matplotlib", "numba", "PIL"):
        logging.getLogger(chatty).setLevel(logging.WARNING)
