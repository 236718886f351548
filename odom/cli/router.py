"""`odom router`: connects the processes of several hosts."""

from pathlib import Path
from typing import Annotated

import typer

from odom.cli import signals
from odom.cli.options import Config, Listen, wire_settings


def router(
    listen: Listen = None,
    connect: Annotated[list[str] | None, typer.Option(help="Another router to join; may be repeated.")] = None,
    allow: Annotated[
        list[str] | None,
        typer.Option(help="Identity that may come in, with its role's rights: sensor.cam0, viewer; may be repeated."),
    ] = None,
    users_file: Annotated[Path | None, typer.Option(help="Users that may come in, lines of user:password.")] = None,
    config: Config = None,
) -> None:
    """Pass messages on between sensor, odometry, recorder and viewer of several hosts.

    It listens on this machine only unless told otherwise. What the rules refuse is logged.

    Example: odom --tls router.pem router.key ca.pem router --listen tls/0.0.0.0:7447 --allow sensor.cam0 --allow viewer
    """
    from odom.wire.router import run_router
    from odom.wire.settings import LOCAL

    stop = signals.stop_event()
    settings = wire_settings(config, connect, listen, "router", None)
    # where all others look for each other when nothing is said is where a router listens
    joined = connect or (settings.connect if settings.connect != (LOCAL,) else ())
    security = settings.security
    given = {"access": tuple(allow or security.access), "users_file": users_file or security.users_file}
    update = {"security": security.model_copy(update=given), "connect": tuple(joined)}
    run_router(settings.model_copy(update=update), stop)
