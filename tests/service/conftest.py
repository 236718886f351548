"""Real `odom` commands in processes of their own."""

import fcntl
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import compiling
import psutil
import pytest

ODOM = [sys.executable, "-m", "odom"]


@pytest.fixture(scope="session")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> None:
    """The compiler's work of a first start is done before anything is timed, and by one worker only."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    with (shared / "compiling").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        compiling.compile_all(compiling.START)


@pytest.fixture
def odom(compiled: None, tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start `odom ARGUMENTS`, words of both streams together in one pipe; whatever still runs at the end is killed."""
    started: list[subprocess.Popen[str]] = []

    def start(*arguments: str | Path, **environment: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [*ODOM, *map(str, arguments)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=tmp_path,
            env={**os.environ, **environment},
        )
        started.append(process)
        return process

    yield start
    for process in started:
        for one in (*_children(process.pid), process.pid):
            if psutil.pid_exists(one):
                try:
                    os.kill(one, signal.SIGKILL)
                except ProcessLookupError:
                    continue
        process.communicate()


def _children(pid: int) -> list[int]:
    try:
        return [child.pid for child in psutil.Process(pid).children(recursive=True)]
    except psutil.NoSuchProcess:
        return []


@pytest.fixture(scope="session")
def eventually() -> Callable[..., None]:
    """Wait until a condition holds; fails with the reason when it does not within the time."""

    def wait(condition: Callable[[], object], timeout_s: float, why: str) -> None:
        deadline = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline, f"not within {timeout_s} s: {why}"
            time.sleep(0.02)

    return wait
