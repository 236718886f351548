"""`odom serve`: the odometry of one device."""

from pathlib import Path
from typing import Annotated

import typer

from odom.cli import signals
from odom.cli.options import (
    Config,
    Connect,
    Listen,
    Localize,
    MapFileOption,
    MaskFile,
    Mode,
    Namespace,
    Ros2,
    check_map,
    out_folder,
    wire_settings,
    with_mask,
)


def serve(
    out: Annotated[Path | None, out_folder("Folder for odometry.txt, trajectory.txt and report.json.")] = None,
    until_end: Annotated[bool, typer.Option("--until-end", help="End when the source ends.")] = False,
    chain: Annotated[
        bool, typer.Option("--chain", hidden=True, help="Not needed: chain.txt is always written.")
    ] = False,
    map_: MapFileOption = None,
    localize: Localize = False,
    mask: MaskFile = None,
    namespace: Namespace = None,
    connect: Connect = None,
    listen: Listen = None,
    mode: Mode = None,
    ros2: Ros2 = None,
    config: Config = None,
) -> None:
    """Estimate the pose of every frame of a device and publish it, until SIGINT or SIGTERM.

    Results of an earlier start in the same folder are kept, in a subfolder named for the time of their end.

    Example: odom serve --namespace cam0 --connect tcp/router.local:7447 --out today
    """
    stop = signals.stop_event()
    from contextlib import ExitStack

    from odom.service.map_keeper import MapKeeper
    from odom.service.odometry_process import serve as run_odometry
    from odom.service.result_files import RunFiles
    from odom.service.run_folder import held
    from odom.service.settings import load_settings
    from odom.wire.session import zenoh_config

    check_map(map_, localize)
    settings = with_mask(load_settings(config), mask)
    wire = wire_settings(config, connect, listen, mode, namespace, ros2)
    settings = settings.model_copy(update={"wire": wire})
    zenoh_config(wire)
    with ExitStack() as stack:
        files = None
        if out is not None:
            stack.enter_context(held(out))
            files = RunFiles(out, endless=not until_end)
        keeper = MapKeeper(map_, localize)
        stack.callback(keeper.close)
        run_odometry(settings, files, stop, until_end, keeper)
