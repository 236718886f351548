"""Under `--log-json` every line of stderr is JSON, whoever writes it: usage errors and libraries, too."""

import atexit
import json
import os
import threading
import time
from typing import TextIO

from odom.cli.streams import open_stream
from odom.service.log_form import is_json

_LAST_WORDS_S = 1.0
"""For the last lines to be passed on at the end; a child that still writes there must not hold the end back."""


def wrap_stderr() -> TextIO:
    """Put whatever is written to stderr from now on into JSON lines; return a stream that leads out directly.

    What is a JSON object passes as it is.
    """
    outside = os.dup(2)
    read_end, write_end = os.pipe()
    os.dup2(write_end, 2)
    os.close(write_end)
    thread = threading.Thread(target=_pass_on, args=(read_end, outside), name="stderr", daemon=True)
    thread.start()

    def end() -> None:
        os.dup2(outside, 2)
        thread.join(_LAST_WORDS_S)

    atexit.register(end)
    return open_stream(outside)


def _pass_on(read_end: int, outside: int) -> None:
    """Pass lines on; no lock is taken that the interpreter may need while it shuts down."""
    with open(read_end, errors="replace") as lines:
        for line in lines:
            words = line.rstrip("\n")
            if words.strip():
                out = words if is_json(words) else _as_json(words)
                _write(outside, f"{out}\n".encode())


def _as_json(words: str) -> str:
    fields = {"time": round(time.time(), 6), "level": "WARNING", "logger": "stderr", "process": os.getpid()}
    return json.dumps({**fields, "message": words})


def _write(outside: int, line: bytes) -> None:
    try:
        os.write(outside, line)
    except OSError:  # nobody reads the log any more
        return
