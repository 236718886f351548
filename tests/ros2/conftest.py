from collections.abc import Iterator

import pytest
from ros2_network import free_port, router


@pytest.fixture
def port() -> Iterator[int]:
    """The port of a router of ROS 2."""
    port = free_port()
    with router(port):
        yield port
