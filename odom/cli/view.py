"""`odom view`: look at a device, from any machine that reaches it."""

from pathlib import Path
from typing import Annotated

import typer

from odom.cli import signals
from odom.cli.options import Config, Connect, Listen, Mode, Namespace, wire_settings
from odom.cli.outputs import timed


def view(
    web: Annotated[bool, typer.Option("--web", help="Serve a web page and print its address.")] = False,
    headless: Annotated[bool, typer.Option("--headless", help="Show nothing; only write --rrd FILE.")] = False,
    rrd: Annotated[
        Path | None,
        typer.Option(help="Write all to this file for Rerun; no window opens. {time} becomes that of the start."),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file of --rrd if it exists.")] = False,
    host: Annotated[str | None, typer.Option(help="Address to serve on; 0.0.0.0 lets other machines look.")] = None,
    web_port: Annotated[int | None, typer.Option(help="Port of the web page.")] = None,
    data_port: Annotated[int | None, typer.Option(help="Port of the data of the page.")] = None,
    namespace: Namespace = None,
    connect: Connect = None,
    listen: Listen = None,
    mode: Mode = None,
    config: Config = None,
) -> None:
    """Show trajectories, images and errors live: in a window, without a screen as a web page, or into a file.

    It may be started late or twice, lag, or die: nothing waits for it. A late one shows the whole trajectory.

    Example: odom view --web
    """
    import cv2

    from odom.service.settings_sources import part_settings
    from odom.viewer import ViewerSettings
    from odom.viewer.outputs import choose
    from odom.viewer.viewer_process import view as show

    cv2.setNumThreads(1)
    stop = signals.stop_event()
    wire = wire_settings(config, connect, listen, mode, namespace)
    given = {"host": host, "web_port": web_port, "data_port": data_port}
    settings = part_settings("viewer", ViewerSettings, config, given)
    outputs = choose(web, headless, rrd and timed(rrd), overwrite)
    show(wire, settings, outputs, stop, lambda address: typer.echo(f"viewer: {address}"))
