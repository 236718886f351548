"""Real `odom` processes for a test: started, watched, ended."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


UNIT = Path(__file__).parents[2] / "odom" / "service" / "systemd" / "odom-serve@.service"


def service_priority() -> list[str]:
    """Return the command that gives a process the priority of the packaged service; empty where that is not allowed."""
    nice = re.findall(r"^Nice=(-\d+)$", UNIT.read_text(), re.MULTILINE)[0]
    given = subprocess.run(["nice", "-n", nice, "nice"], capture_output=True, text=True, check=True).stdout.strip()
    return ["nice", "-n", nice] if given == nice else []


class Process:
    """One `odom` process, its standard error in a file; `prefix` is put before the command (`ip netns exec ...`)."""

    def __init__(
        self, name: str, log: Path, arguments: Sequence[object], prefix: Sequence[str] = (), **environment: str
    ) -> None:
        self.name = name
        self.log = log
        self._command = [*prefix, sys.executable, "-m", "odom", *(str(argument) for argument in arguments)]
        self._environment = os.environ | {"PYTHONUNBUFFERED": "1"} | environment
        self.start()

    def start(self) -> None:
        with self.log.open("ab") as log:
            self.popen = subprocess.Popen(self._command, stdout=log, stderr=log, env=self._environment)

    @property
    def said(self) -> str:
        return self.log.read_text(errors="replace")

    def wait_for(self, text: str, seconds: float = 15.0, after: int = 0) -> None:
        """Wait until `text` was said, behind the first `after` characters."""
        end = time.monotonic() + seconds
        while text not in self.said[after:]:
            assert self.popen.poll() is None, f"{self.name} ended: {self.said}"
            assert time.monotonic() < end, f"{self.name} did not say {text!r}: {self.said}"
            time.sleep(0.02)

    def end(self, seconds: float = 20.0) -> int:
        if self.popen.poll() is None:
            self.popen.send_signal(signal.SIGTERM)
        try:
            return self.popen.wait(seconds)
        except subprocess.TimeoutExpired:
            self.popen.kill()
            self.popen.wait()
            raise AssertionError(f"{self.name} did not end: {self.said[-2000:]}") from None

    def kill(self) -> None:
        self.popen.kill()
        self.popen.wait()


@contextmanager
def processes() -> Iterator[list[Process]]:
    """Whatever is put into the list is dead at the end."""
    started: list[Process] = []
    try:
        yield started
    finally:
        for process in reversed(started):
            if process.popen.poll() is None:
                process.kill()
