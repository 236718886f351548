"""The type of the fixture `open_peer`."""

from collections.abc import Callable

from odom.wire.session import WireSession

OpenSession = Callable[[], WireSession]
