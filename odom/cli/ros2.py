"""`odom ros2`: the bridge to ROS 2 on DDS."""

from typing import TYPE_CHECKING, Annotated

import typer

from odom.cli import options, signals
from odom.cli.optional_domain import domain_of_environment
from odom.errors import WireError

if TYPE_CHECKING:
    from contextlib import ExitStack

    from odom.ros2_bridge.bridge import Bridge
    from odom.wire import WireSettings
    from odom.wire.session import WireSession


def ros2(
    domain: Annotated[
        int | None, typer.Option(min=0, max=232, help="ROS domain of both sides; by default $ROS_DOMAIN_ID or 0.")
    ] = None,
    below: Annotated[
        list[str] | None, typer.Option(help="Carry only topics below this name, as /cam0; may be repeated.")
    ] = None,
    config: options.Config = None,
) -> None:
    """Carry topics between this project's processes (--ros2) and ROS 2 on DDS, both ways, until Ctrl-C.

    A topic is offered on the other side and carried while somebody there listens. Where no router of ROS 2 on Zenoh
    runs on this machine, the bridge is it.

    Example: odom ros2 --below /cam0 --below /tf
    """
    stop = signals.stop_event()
    from contextlib import ExitStack

    from odom.ros2_bridge.bridge import Bridge
    from odom.ros2_bridge.dds import DdsNode

    number = domain if domain is not None else domain_of_environment()
    wire = options.wire_settings(config, None, None, None, None, number)
    with ExitStack() as stack:
        dds = DdsNode(number)
        stack.callback(dds.close)
        session = _session(stack, wire)
        bridge = Bridge(session, dds, number, below or ())
        typer.echo(f"carrying topics of domain {number} between DDS and {wire.ros2_router} until Ctrl-C", err=True)
        bridge.run(stop)
    _tell(bridge)


def _session(stack: "ExitStack", wire: "WireSettings") -> "WireSession":
    """Return a session of which this process is the router, if none is where it should be on this machine."""
    from odom.wire.ros2.node import ros2_wire
    from odom.wire.ros2.router_watch import RouterWatch
    from odom.wire.session import open_session

    member = ros2_wire(wire)
    host = wire.ros2_router.partition("/")[2].rpartition(":")[0]
    if host in ("localhost", "127.0.0.1", "[::1]"):
        as_router = member.model_copy(update={"mode": "router", "connect": (), "listen": (wire.ros2_router,)})
        try:
            return stack.enter_context(open_session(as_router))
        except WireError as error:
            if "listen" not in str(error):
                raise
    session = stack.enter_context(open_session(member))
    stack.callback(RouterWatch(session.zenoh, wire.ros2_router).close)
    return session


def _tell(bridge: "Bridge") -> None:
    for side, traffic in (("DDS", bridge.to_dds), ("Zenoh", bridge.to_zenoh)):
        for topic, count in sorted(traffic.carried.items()):
            typer.echo(f"to {side}  {topic}: {count} messages, {bridge.lost[topic]} lost")
    dropped = bridge.inbox.counts
    typer.echo(f"dropped since newer ones came: {dropped['dropped']}, lost on Zenoh: {dropped['lost']}")
