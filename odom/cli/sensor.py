"""`odom sensor SOURCE`: one sensor, folder or recording on the wire."""

import threading
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from odom.cli import options, signals

if TYPE_CHECKING:
    from odom.wire.settings import WireSettings
    from sensors.source import SourceOptions


def sensor(
    source: options.SourceName,
    camera: options.Calibration = None,
    namespace: options.Namespace = None,
    start: options.Start = 0.0,
    end: options.End = None,
    realtime: Annotated[bool, typer.Option(help="Play a recording like a live sensor: newest frame wins.")] = False,
    rate: options.Rate = 1.0,
    loop: Annotated[bool, typer.Option(help="Begin again at the end, stamps going on.")] = False,
    color: Annotated[Literal["jpeg", "raw"], typer.Option(help="How a live sensor sends colour.")] = "jpeg",
    depth: Annotated[Literal["raw", "rvl", "png"], typer.Option(help="How a live sensor sends depth.")] = "raw",
    topic: options.OwnTopics = None,
    option: options.SourceOption = None,
    kind: options.SimulatedSensor = "kinect1",
    seed: options.Seed = 1,
    seconds: options.Seconds = None,
    live: Annotated[bool, typer.Option(help="Run the arena like a live sensor, at its frame rate.")] = False,
    consumers: Annotated[
        int | None, typer.Option(min=0, help="Wait for so many consumers first (recorded: 1, live: 0).")
    ] = None,
    check: Annotated[bool, typer.Option("--check", help="Only say whether SOURCE and options can be used.")] = False,
    connect: options.Connect = None,
    listen: options.Listen = None,
    mode: options.Mode = None,
    ros2: options.Ros2 = None,
    config: options.Config = None,
) -> None:
    """Publish a sensor, a folder or a recording.

    A recording goes out without loss as fast as its consumers acknowledge, at most a few frames ahead.

    Example: odom sensor session.mcap --start 5 --end 20
    """
    stop = None if check else signals.stop_event()
    from odom.wire import Topics
    from odom.wire.ros2 import check_no_loop
    from sensors.catalogue import check_source
    from sensors.source import SourceOptions

    settings = options.wire_settings(config, connect, listen, mode, namespace, ros2)
    selected = SourceOptions(
        topics=Topics(settings.namespace),
        camera=camera,
        start=start,
        end=end,
        realtime=realtime,
        rate=rate,
        loop=loop,
        color=color,
        depth=depth,
        topics_from=options.pairs("--topic", topic),
        sensor=kind,
        seed=seed,
        seconds=seconds,
        live=live,
        extra=options.pairs("--option", option),
    )
    check_no_loop(source, settings)
    if stop is None:
        check_source(source, selected)
    else:
        _publish(source, selected, settings, consumers, stop)


def _publish(
    source: str, selected: "SourceOptions", settings: "WireSettings", consumers: int | None, stop: threading.Event
) -> None:
    import cv2

    from odom.service.input_report import source_report
    from odom.service.progress import counting, hand_up
    from odom.wire.ros2 import join_ros2
    from odom.wire.session import open_session
    from sensors.catalogue import open_source
    from sensors.process import END_OF_SOURCE, SensorProcess
    from sensors.source import damage_of, refused_images, serial_of

    cv2.setNumThreads(1)
    opened = signals.before(stop, lambda: open_source(source, selected))
    try:
        wanted = consumers if consumers is not None else int(opened.lossless)
        with open_session(settings) as session, counting("sensor", opened.length) as progress:
            mirror = join_ros2(session, settings, "sensor")
            process = SensorProcess(session, opened, selected, wanted, mirror)
            try:
                report = process.run(stop, progress)
            finally:
                has_ended = process.ended == END_OF_SOURCE
                refused, damage = refused_images(opened), damage_of(opened)
                said = source_report(process.frames, opened.length, has_ended, refused, damage)
                hand_up(said | {"serial": serial_of(opened)})
    finally:
        opened.close()
    lost = f", {report.lost} messages lost by consumers" if report.lost else ""
    typer.echo(f"{source}: {report.frames} frames, {report.messages} messages sent{lost}; {report.reason}")
