"""A made-up device and `odom view` as processes of their own."""

import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from viewer_processes import Running

HERE = Path(__file__).parent


@pytest.fixture
def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@pytest.fixture
def start(endpoint: str) -> Iterator[Callable[..., Running]]:
    """Start `device` (made up) or an `odom` command that finds it; what still runs at the end is killed."""
    running: list[Running] = []

    def begin(what: str, *arguments: str | Path, listen: str = '["tcp/127.0.0.1:0"]', **environment: str) -> Running:
        command = [str(HERE / "device_process.py"), endpoint] if what == "device" else ["-m", "odom", what]
        environment |= {"ODOM_WIRE__CONNECT": f'["{endpoint}"]', "ODOM_WIRE__LISTEN": listen}
        one = Running([*command, *map(str, arguments)], environment)
        running.append(one)
        return one

    yield begin
    for one in running:
        one.kill()
