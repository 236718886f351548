import socket
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from private_network import OpenSession

from odom.wire import WireSettings
from odom.wire.session import WireSession, open_session
from odom.wire.settings import ANY_LOCAL_PORT


@pytest.fixture
def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@pytest.fixture
def open_peer(endpoint: str) -> Iterator[OpenSession]:
    """Open sessions of one private network, the first of which listens where the others connect."""
    with ExitStack() as stack:
        opened: list[WireSession] = []

        def open_one() -> WireSession:
            first = WireSettings(connect=(), listen=(endpoint,))
            other = WireSettings(connect=(endpoint,), listen=(ANY_LOCAL_PORT,))
            session = stack.enter_context(open_session(other if opened else first))
            opened.append(session)
            return session

        yield open_one
