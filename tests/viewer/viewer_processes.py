"""Processes of the viewer's tests."""

import os
import re
import subprocess
import sys
import threading
import time

import psutil


class Running:
    """A process whose lines are collected as they come."""

    def __init__(self, arguments: list[str], environment: dict[str, str]) -> None:
        self.process = subprocess.Popen(
            [sys.executable, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, **environment},
        )
        self.lines: list[str] = []
        threading.Thread(target=self._read, daemon=True).start()

    @property
    def pid(self) -> int:
        return self.process.pid

    def family(self) -> list[psutil.Process]:
        """The process and its children."""
        own = psutil.Process(self.pid)
        return [own, *own.children(recursive=True)]

    def said(self, pattern: str) -> str | None:
        """The first group (or all) of the last line that matches."""
        for line in reversed(self.lines):
            if found := re.search(pattern, line):
                return found.group(found.re.groups and 1)
        return None

    def wait_for(self, pattern: str, timeout_s: float) -> str:
        deadline = time.monotonic() + timeout_s
        while (found := self.said(pattern)) is None:
            assert time.monotonic() < deadline, f"no {pattern!r} within {timeout_s} s in {self.lines[-20:]}"
            assert self.process.poll() is None or self.said(pattern), f"ended: {self.lines[-20:]}"
            time.sleep(0.05)
        return found

    def stop(self, timeout_s: float = 60.0) -> int:
        self.process.terminate()
        return self.process.wait(timeout_s)

    def kill(self) -> None:
        for one in self.family() if psutil.pid_exists(self.pid) and self.process.poll() is None else []:
            one.kill()
        self.process.wait()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n"))
