"""Rerun's own programs as processes that end with this one: its window, and what serves the web page."""

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

import psutil

from odom.errors import OdomError
from odom.viewer.usage_data import without_usage_data

_LISTEN_S = 2.0
"""For this process to listen on a port, which it does at once; then the port counts as taken."""
_START_S = 30.0
"""For a program to start and listen, tenths of a second where the machine is idle; one that cannot listen ends."""
_LISTEN_POLL_S = 0.02
"""Between two looks whether it does."""
_END_S = 5.0
"""For a program to end when asked, before it is killed."""
_ASKED_TO_END = (0, *(code for n in (signal.SIGINT, signal.SIGTERM) for code in (-n, 128 + n)))
"""Statuses of a window that was closed, and of programs that were ended by Ctrl-C or from outside."""
_SET_PARENT_DEATH_SIGNAL = 1
"""PR_SET_PDEATHSIG of prctl(2)."""


@dataclass(frozen=True)
class RerunProgram:
    """A program that runs: the `part` of the viewer that it is, what to do when it fails, and its error output."""

    part: str
    advice: str
    process: subprocess.Popen[bytes]
    errors: IO[bytes]

    @property
    def has_ended(self) -> bool:
        """Whether it was closed by its user or asked to end; raises OdomError when it ended for another reason."""
        status = self.process.poll()
        if status not in (None, *_ASKED_TO_END):
            raise OdomError(f"Rerun's {self.part} ended with status {status}: {self.last_line}; {self.advice}")
        return status is not None

    def comes_to_listen(self, port: int) -> bool:
        """Wait until it listens on the port; False when it ends before, or is too slow."""
        return _comes_to_listen(self.process.pid, port, _START_S, lambda: self.process.poll() is not None)

    @property
    def last_line(self) -> str:
        """What it said last of its errors."""
        self.errors.seek(0)
        return (self.errors.read().decode(errors="replace").strip().splitlines() or ["it does not say why"])[-1]


def this_process_listens(port: int) -> bool:
    """Return whether this process listens on the port, or does so soon."""
    return _comes_to_listen(os.getpid(), port, _LISTEN_S, lambda: False)


def _comes_to_listen(pid: int, port: int, within_s: float, has_ended: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + within_s
    while time.monotonic() < deadline and not has_ended():
        if _listens(pid, port):
            return True
        time.sleep(_LISTEN_POLL_S)
    return False


def _listens(pid: int, port: int) -> bool:
    with suppress(psutil.Error):  # it ends just now
        connections = psutil.Process(pid).net_connections("tcp")
        return any(c.status == psutil.CONN_LISTEN and c.laddr.port == port for c in connections)
    return False


@contextmanager
def running(part: str, advice: str, arguments: Sequence[str]) -> Iterator[RerunProgram]:
    """Run Rerun's program with these arguments (see `RerunProgram`); it sends no usage data, and is ended at the end.

    Raises OdomError when the program is missing.
    """
    with without_usage_data() as environment, TemporaryFile() as errors:
        process = subprocess.Popen(
            [str(program()), *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            env=environment,
            preexec_fn=_end_with_parent if sys.platform == "linux" else None,
        )
        try:
            yield RerunProgram(part, advice, process, errors)
        finally:
            process.terminate()
            try:
                process.wait(_END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def program() -> Path:
    """Return the path of Rerun's program; raises OdomError when it is missing."""
    package = find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise OdomError("Rerun's program is missing: reinstall rerun-sdk")
    return Path(package.origin).with_name("rerun.exe" if sys.platform == "win32" else "rerun")


def _end_with_parent() -> None:
    """Let Linux end the child with its parent, even by kill -9: it would keep the port otherwise."""
    ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGTERM)
