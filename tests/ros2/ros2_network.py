"""A ROS 2 network for tests: its router, and what other nodes of it see."""

import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import zenoh

from odom.frame import Stamp
from odom.wire import Message, WireSettings
from odom.wire.codec import restamp
from odom.wire.ros2 import Ros2Node
from odom.wire.ros2.names import NodeName
from odom.wire.ros2.node import ros2_wire
from odom.wire.session import WireSession, open_session
from odom.wire.settings import ANY_LOCAL_PORT

DOMAIN = 10 + os.getpid() % 90
"""One of this process's own: DDS has no other walls between tests that run at the same time."""
_LISTENER = Path(__file__).with_name("sdk_listener.py")


@contextmanager
def again_and_again(
    publish: Callable[[Message], None], messages: Sequence[Message], period_s: float = 0.1
) -> Iterator[None]:
    """Publish messages by a thread, all of them every so many seconds."""
    stop = threading.Event()

    def run() -> None:
        while not stop.wait(period_s):
            for message in messages:
                publish(message)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


@contextmanager
def driver(port: int, messages: Sequence[Message], node: str = "camera", period_s: float = 0.05) -> Iterator[None]:
    """Publish messages again and again, each time with the stamp of the moment, as a node of ROS 2."""
    with other_node(port) as session:
        name = NodeName(DOMAIN, str(session.zenoh.info.zid()), 0, "/", node)
        publisher = Ros2Node(session.zenoh, name)

        def publish(message: Message) -> None:
            publisher.tell(restamp(message, Stamp(time.time_ns())))

        try:
            with again_and_again(publish, messages, period_s):
                yield
        finally:
            publisher.close()


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def router(port: int) -> Any:
    """Open what `odom router` opens, where rmw_zenohd would listen."""
    return open_session(WireSettings(mode="router", connect=(), listen=(f"tcp/127.0.0.1:{port}",)))


def wire_of(port: int, **changes: Any) -> WireSettings:
    """Settings of a process that stands alone but for ROS 2."""
    alone: dict[str, Any] = {"connect": (), "listen": (ANY_LOCAL_PORT,), "ros2_domain": DOMAIN}
    return WireSettings(**(alone | {"ros2_router": f"tcp/127.0.0.1:{port}"} | changes))


def other_node(port: int) -> Any:
    """Open a session as another node of ROS 2 does."""
    return open_session(ros2_wire(wire_of(port)))


def tokens(session: WireSession) -> set[str]:
    """What the ROS graph of the domain holds."""
    replies = session.zenoh.liveliness().get(f"@ros2_lv/{DOMAIN}/**", timeout=2.0)
    return {str(reply.ok.key_expr) for reply in replies if isinstance(reply.ok, zenoh.Sample)}


@contextmanager
def listener(port: int, *topics: str) -> Iterator[Iterator[dict[str, Any]]]:
    """Yield what a subscriber of `zenoh-ros2-sdk` in another process is told, beginning when it is ready."""
    pytest.importorskip("zenoh_ros2_sdk", reason="the wheel zenoh-ros2-sdk is missing")
    command = [sys.executable, str(_LISTENER), str(port), str(DOMAIN), *topics]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            lines = (json.loads(line) for line in process.stdout)
            yield lines
        finally:
            process.kill()
