"""Fixtures that every test may use, the marks of the tests, and what a fast test is refused."""

import gc
import logging
import os
import sys
from collections.abc import Generator, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import compiling
import drawn
import kinds
import pytest
import typer.testing
from hypothesis import settings

from odom.cli import ONE_THREAD
from odom.geometry.compiled import compiled_before

settings.register_profile("shared-machine", deadline=None, derandomize=True, max_examples=10)
settings.register_profile("thorough", settings.get_profile("shared-machine"), max_examples=100)  # as .ci/run's
settings.load_profile("shared-machine")

if hasattr(typer.testing, "_get_command"):  # built for each call, `odom`'s many commands take longer than most of them
    typer.testing._get_command = cache(typer.testing._get_command)

FORBIDDEN = ("subprocess.Popen", "os.fork", "os.posix_spawn", "socket.connect", "socket.bind")
"""What a fast test may not do: Python's audit events."""
HARMLESS = ("fc-list",)
"""Programs by which matplotlib looks for fonts when it is first imported."""


def pytest_configure(config: pytest.Config) -> None:
    os.environ.update(dict.fromkeys((*ONE_THREAD, "OPENCV_FOR_THREADS_NUM"), "1"))  # for the workers, as in a command
    for kind, meaning in kinds.KINDS.items():
        config.addinivalue_line("markers", f"{kind}: {meaning}")
    if getattr(config, "cache", None) is not None:
        os.environ.setdefault(drawn.ENVIRONMENT, str(config.cache.mkdir("frames")))
    sys.addaudithook(_refuse)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Before the workers of the whole suite start, compile what both of them need."""
    config = session.config
    is_whole = config.args_source is config.ArgsSource.TESTPATHS and not config.option.collectonly
    if is_whole and not hasattr(config, "workerinput") and not compiled_before():
        os.environ[compiling.FIRST_START], _ = compiling.compile_all(compiling.START, compiling.ARENA)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect without looking for garbage: modules stay, and to look at all of them again and again takes a second."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        kinds.mark(item)


_is_fast = False


@pytest.fixture(autouse=True)
def _fast_stays_fast(request: pytest.FixtureRequest) -> Iterator[None]:
    global _is_fast
    _is_fast = request.node.get_closest_marker("fast") is not None
    yield
    _is_fast = False


@pytest.fixture(autouse=True)
def _log_of_its_own() -> None:
    """A command that runs in this process, in a test or for a module's tests, sets up the process's log: undo that."""
    root = logging.getLogger()
    root.setLevel(logging.WARNING)
    root.handlers[:] = [each for each in root.handlers if not type(each).__module__.startswith("odom.")]


def _refuse(event: str, arguments: tuple[Any, ...]) -> None:
    if _is_fast and event in FORBIDDEN and arguments[0] not in HARMLESS:
        raise AssertionError(f"{event}{arguments}: mark this test `process`, it is no fast one")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real recordings, or a skip that says where it was looked for."""
    folder = Path(os.environ.get("ODOM_SHARED_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not (folder / "tum_fr1_xyz" / "rgb.txt").is_file():
        pytest.skip(f"no real recordings at {folder}: set ODOM_SHARED_DATA to the folder that holds tum_fr1_xyz")
    return folder
