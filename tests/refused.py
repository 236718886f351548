"""A wrong call of a command, made in this process: one of its own would load libraries for a second first."""

import logging
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from odom.cli import app
from odom.errors import ConfigError


@contextmanager
def process_as_it_was() -> Iterator[None]:
    """No signal handler, environment or log of a command outlives the block."""
    before, handlers = dict(os.environ), logging.getLogger().handlers[:]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("odom.cli.signals.stop_event", threading.Event)
        yield
    os.environ.clear()
    os.environ.update(before)
    logging.getLogger().handlers[:] = handlers


def refusal(*arguments: str | Path) -> str:
    """The words with which `odom ARGUMENTS` is refused; anything but a refusal with status 2 is a failure."""
    with process_as_it_was():
        done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if isinstance(done.exception, ConfigError):
        return str(done.exception)
    assert done.exit_code == 2, (done.output, done.exception)
    return " ".join(line.strip("│ ") for line in done.output.splitlines())
