"""Whether lines of the log are JSON: said on the command line, and to children in the environment."""

import json
import os

JSON_ENVIRONMENT = "ODOM_LOG_JSON"


def as_json() -> bool:
    """Return whether log lines are JSON."""
    return os.environ.get(JSON_ENVIRONMENT) == "1"


def is_json(line: str) -> bool:
    """Return whether a line is a JSON object."""
    try:
        return line.startswith("{") and isinstance(json.loads(line), dict)
    except (ValueError, RecursionError):
        return False
