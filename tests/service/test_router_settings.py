"""The router takes its settings from the command line, the environment and the file like every other process."""

import pytest
from typer.testing import CliRunner

from odom.cli import app
from odom.wire import WireSettings


@pytest.mark.parametrize(
    ("environment", "arguments", "joined"),
    [
        ({}, (), ()),
        ({"ODOM_WIRE__CONNECT": '["tcp/other:7447"]'}, (), ("tcp/other:7447",)),
        ({"ODOM_WIRE__CONNECT": '["tcp/other:7447"]'}, ("--connect", "tcp/third:7447"), ("tcp/third:7447",)),
        ({"ODOM_WIRE__CONNECT": '["tcp/127.0.0.1:7447"]'}, (), ()),
        ({}, ("--connect", "tcp/127.0.0.1:7447"), ("tcp/127.0.0.1:7447",)),
    ],
)
def test_a_router_joins_the_others_that_it_is_told_of_and_nobody_else(
    monkeypatch: pytest.MonkeyPatch, environment: dict[str, str], arguments: tuple[str, ...], joined: tuple[str, ...]
) -> None:
    given: list[WireSettings] = []
    monkeypatch.setattr("odom.wire.router.run_router", lambda settings, stop: given.append(settings))
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    done = CliRunner().invoke(app, ["router", *arguments])
    assert done.exit_code == 0, done.output
    assert [settings.connect for settings in given] == [joined]
