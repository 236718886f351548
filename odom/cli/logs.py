"""One format of log lines on stderr for every process: text for people, `--log-json` for machines."""

import json
import logging
import os
import sys
import time
from enum import StrEnum

LEVEL_ENVIRONMENT = "ODOM_LOG_LEVEL"
JSON_ENVIRONMENT = "ODOM_LOG_JSON"


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


def configure(level: Level, as_json: bool) -> None:
    """Put log lines on stderr, and into the environment so that children log alike."""
    os.environ[LEVEL_ENVIRONMENT] = level.value
    os.environ[JSON_ENVIRONMENT] = "1" if as_json else "0"
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_JsonFormatter() if as_json else _TextFormatter())
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level.value)
    for chatty in ("matplotlib", "numba", "PIL"):
        logging.getLogger(chatty).setLevel(logging.WARNING)


def as_json() -> bool:
    """Return whether log lines are JSON."""
    return os.environ.get(JSON_ENVIRONMENT) == "1"
