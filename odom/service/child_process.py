"""Child processes of `odom run`: their output is passed on, their memory and CPU time are measured.

Each ends by itself when the process that started it is gone.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import psutil

from odom.service.parent_watch import PARENT_ENVIRONMENT

CALLED_WRONGLY = 2
"""Exit status of a command that was called wrongly: another attempt cannot change it."""
_EXIT_POLL_S = 0.02
"""Time between two checks whether a child has ended; longer delays the end of a run, shorter costs CPU."""
_KILLED_S = 5.0
"""After SIGKILL; only a process in an uninterruptible system call takes longer."""
_LONGEST_LINE = 1 << 16
"""Characters of a line that are passed on together: a child that never ends one must not fill the memory."""

Say = Callable[[str, str], None]
"""Called with the name of a child and one line of its output."""


class ChildProcess:
    """One `python -m odom ...` process in a session of its own: Ctrl-C does not reach it, `odom run` ends it.

    It inherits the open files `descriptors`.
    """

    def __init__(
        self,
        name: str,
        arguments: Sequence[str],
        environment: Mapping[str, str],
        say: Say,
        descriptors: Sequence[int] = (),
    ) -> None:
        self.name = name
        self.peak_rss_mb = 0.0
        self.cpu_s = 0.0
        self._asked_to_stop = False
        self._hung_s: float | None = None
        self._process = subprocess.Popen(
            [sys.executable, "-m", "odom", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env={**os.environ, **environment, PARENT_ENVIRONMENT: str(os.getpid())},
            start_new_session=True,
            pass_fds=descriptors,
            text=True,
            errors="replace",
        )
        self._reader = threading.Thread(target=self._pass_on, args=(say,), name=f"{name}-lines", daemon=True)
        self._reader.start()

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def poll(self) -> int | None:
        """Measure the process and return its exit status, negative for a signal, None while it runs."""
        self._measure()
        return self._process.poll()

    @property
    def status(self) -> int | None:
        """Exit status, negative for a signal, None while it runs."""
        return self._process.poll()

    @property
    def failed(self) -> bool:
        """Whether it has ended otherwise than with status 0 or by the SIGTERM that it was sent."""
        return self.status not in (None, 0, -signal.SIGTERM if self._asked_to_stop else 0)

    def ending(self) -> str:
        """Return how it ended, in words."""
        status = self.status
        if status is None:
            return "is running"
        if self._hung_s is not None:
            return f"did not end within {self._hung_s:g} s and was killed"
        if status < 0:
            with suppress(ValueError):
                return f"was killed by {signal.Signals(-status).name}"
        return f"ended with status {status}"

    def ask_to_stop(self) -> None:
        """Send SIGTERM."""
        self._asked_to_stop = True
        self._process.terminate()

    def wait(self, timeout_s: float) -> bool:
        """Wait until it has ended; False when it did not within the time."""
        deadline = time.monotonic() + timeout_s
        while self.poll() is None:
            if time.monotonic() > deadline:
                return False
            time.sleep(_EXIT_POLL_S)
        self._reader.join(timeout=1.0)
        return True

    def stop(self, timeout_s: float) -> None:
        """Ask it to stop, and kill it if it has not ended within the time."""
        if self.poll() is None:
            self.ask_to_stop()
            if not self.wait(timeout_s):
                self._hung_s = timeout_s
                self._process.kill()
                self.wait(_KILLED_S)

    def _measure(self) -> None:
        with suppress(psutil.Error, OSError, ValueError):
            process = psutil.Process(self.pid)
            used = process.cpu_times()
            self.cpu_s = used.user + used.system
            self.peak_rss_mb = max(self.peak_rss_mb, peak_rss_mb(process))

    def _pass_on(self, say: Say) -> None:
        assert self._process.stdout is not None
        while line := self._process.stdout.readline(_LONGEST_LINE):
            say(self.name, line.rstrip("\n"))


def peak_rss_mb(process: psutil.Process) -> float:
    """Return the highest resident memory of a process so far where the system knows it (Linux), else the present one.

    What `getrusage` says of a process that was just begun may be the memory of the one that began it.
    """
    status = Path(f"/proc/{process.pid}/status")
    if status.exists():
        for line in status.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024
    return float(process.memory_info().rss) / 2**20
