"""`odom run SOURCE`: the main job."""

import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from odom.cli import options, signals
from odom.cli.outputs import check_recording
from odom.cli.sensor import sensor as sensor_command
from odom.cli.summary import summary
from odom.errors import ConfigError, OdomError

if TYPE_CHECKING:
    from sensors.source import Source


def run(
    source: options.SourceName = "arena",
    out: Annotated[
        Path | None,
        options.out_folder("Folder of the run's files; without it one below out/ named for source and time."),
    ] = None,
    headless: Annotated[bool, typer.Option("--headless", help="Show nothing.")] = False,
    web: Annotated[bool, typer.Option("--web", help="Show the run in a browser instead of a window.")] = False,
    rrd: Annotated[bool, typer.Option("--rrd", help="Write session.rrd for Rerun; no window opens.")] = False,
    stay: Annotated[bool, typer.Option("--stay", help="Keep the viewer open until Ctrl-C.")] = False,
    record: Annotated[Path | None, typer.Option(help="Record the session to this .mcap file meanwhile.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file of --record if it exists.")] = False,
    chain: Annotated[
        bool, typer.Option("--chain", hidden=True, help="Not needed: chain.txt is always written.")
    ] = False,
    map_: options.MapFileOption = None,
    localize: options.Localize = False,
    camera: options.Calibration = None,
    mask: options.MaskFile = None,
    remember: Annotated[
        bool, typer.Option("--remember", help="Use the calibration that is found in this device's next runs, too.")
    ] = False,
    start: options.Start = 0.0,
    end: options.End = None,
    realtime: Annotated[bool, typer.Option("--realtime", help="Play a recording like a live sensor.")] = False,
    rate: options.Rate = 1.0,
    live: Annotated[bool, typer.Option("--live", help="Run the arena like a live sensor.")] = False,
    seconds: options.Seconds = None,
    seed: options.Seed = 1,
    topic: options.OwnTopics = None,
    option: options.SourceOption = None,
    kind: options.SimulatedSensor = "kinect1",
    sensor_option: Annotated[
        list[str] | None, typer.Option(help="A further argument of `odom sensor`, as in --sensor-option=--depth=rvl.")
    ] = None,
    namespace: options.Namespace = None,
    ros2: options.Ros2 = None,
    config: options.Config = None,
) -> None:
    """Track a source to its end or Ctrl-C, and leave trajectory, report and plot in a folder.

    Example: odom run recordings/arena.mcap --headless --out out/first
    """
    stop = signals.stop_event()
    from odom.service.local_run import run as run_all
    from odom.service.run_folder import new_folder
    from odom.service.run_processes import RunPlan
    from odom.service.settings import load_settings
    from odom.service.settings_sources import CONFIG_ENVIRONMENT
    from odom.wire.session import zenoh_config
    from odom.wire.topics import Topics
    from sensors.catalogue import check_images, open_source
    from sensors.source import SourceOptions

    if config is not None:
        os.environ[CONFIG_ENVIRONMENT] = str(config.resolve())
    settings = load_settings(config)
    if namespace is not None:
        settings = settings.model_copy(update={"wire": settings.wire.model_copy(update={"namespace": namespace})})
    if ros2 is not None:
        settings = settings.model_copy(update={"wire": settings.wire.model_copy(update={"ros2_domain": ros2})})
    sensor = [f"--start={start}", f"--rate={rate}", f"--seed={seed}", f"--sensor={kind}"]
    sensor += [f"--topic={one}" for one in topic or ()]
    sensor += [f"--option={one}" for one in option or ()]
    sensor += [f"--seconds={seconds}"] if seconds is not None else []
    sensor += [f"--camera={camera}"] if camera is not None else []
    sensor += [f"--end={end}"] if end is not None else []
    sensor += ["--realtime"] if realtime else []
    sensor += ["--live"] if live else []
    sensor += sensor_option or ()
    if headless and web:
        raise ConfigError("--headless and --web contradict each other: give one of them")
    Topics(settings.wire.namespace)
    zenoh_config(settings.wire.model_copy(update={"connect": (), "listen": ()}))  # a run meets at its own endpoint
    _check_sensor(source, sensor)
    check_images(source)
    options.check_map(map_, localize)
    settings = options.with_mask(settings, mask)
    if record is not None:
        check_recording(source, record, overwrite, out, map_)
    folder = out or new_folder(Path("out") / f"{_stem(source)}-{time.strftime('%Y%m%d-%H%M%S')}")
    viewer = [*(["--web"] if web else []), *(["--headless"] if headless else [])]
    viewer += [f"--rrd={folder / 'session.rrd'}"] if rrd else []
    plan = RunPlan(
        source=source,
        out=folder,
        camera=camera,
        start=start,
        sensor_arguments=sensor,
        odometry_arguments=options.odometry_arguments(map_, localize, mask),
        record=record,
        overwrite=overwrite,
        viewer_arguments=viewer if rrd or not headless else None,
        stay=stay,
        remember=remember,
    )

    def tell(report: dict[str, Any]) -> None:
        for line in summary(report, folder):
            typer.echo(line)

    def open_again() -> "Source":
        options_again = SourceOptions(
            camera=camera, start=start, end=end, topics_from=options.pairs("--topic", topic),
            extra=options.pairs("--option", option),
        )  # fmt: skip
        return open_source(source, options_again)

    run_all(plan, settings, stop, tell, open_again if Path(source).exists() else None)


def _check_sensor(source: str, arguments: list[str]) -> None:
    """Refuse, before anything is touched, what `odom sensor` would refuse."""
    from odom.service.unlogged import unlogged

    alone = typer.Typer(add_completion=False)
    alone.command()(sensor_command)
    try:
        with unlogged():  # the sensor says the same
            typer.main.get_command(alone).main(
                ["--check", *arguments, "--", source], prog_name="odom sensor", standalone_mode=False
            )
    except OdomError as error:
        raise ConfigError(str(error)) from error


def _stem(source: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in Path(source).stem).strip("-") or "run"
