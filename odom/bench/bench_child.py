"""A run of a bench in a process of its own: what it prints, and why it ended early."""

import json
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

_POLL_S = 0.2
"""How often a waiting thread looks whether the bench is to stop: shorter costs CPU, longer delays Ctrl-C."""
_PATIENCE, _PATIENCE_S = 10.0, 60.0
"""A run is stopped after so many times the usual run's time, and a minute: some changes keep a loop from ending."""


@dataclass(frozen=True)
class ChildResult:
    """The JSON values that a child printed, one a line, and why nothing more came (for one that ended early)."""

    values: tuple[Any, ...]
    why: str


def patience_s(usual_s: float) -> float:
    """Return the seconds after which a run is given up, by those that the usual one took."""
    return _PATIENCE * usual_s + _PATIENCE_S


def run_child(module: str, task: object, limit_s: float | None, stopped: Callable[[], bool]) -> ChildResult:
    """Run `python -m MODULE TASK`, the task as JSON, until it ends, is `stopped`, or has taken `limit_s` seconds."""
    begun, why = time.monotonic(), ""
    with subprocess.Popen(
        [sys.executable, "-m", module, json.dumps(task)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as child:
        while True:
            with suppress(subprocess.TimeoutExpired):
                out, err = child.communicate(timeout=_POLL_S)
                break
            if limit_s is not None and time.monotonic() - begun > limit_s:
                why = f"given up after {limit_s:.0f} s"
                child.kill()
            if stopped():
                child.kill()
    values = tuple(json.loads(line) for line in out.splitlines() if line[:1] in ("[", "{"))  # not printed by a library
    last_words = err.strip().splitlines()[-1:] or [""]
    return ChildResult(values, why or f"the process ended with status {child.returncode}: {last_words[0]}")
