"""`odom record OUT.mcap`: everything of a device, from the wire into a file."""

import logging
from pathlib import Path
from typing import Annotated

import typer

from odom.cli import signals
from odom.cli.options import Compression, Config, Connect, Listen, Mode, Namespace, wire_settings
from odom.cli.outputs import check_recording_name, timed

_LOG = logging.getLogger(__name__)


def record(
    output: Annotated[
        Path,
        typer.Argument(
            help="The .mcap recording to write; {time} becomes that of the start, -2 is added to a taken one."
        ),
    ],
    namespace: Namespace = None,
    estimates: Annotated[bool, typer.Option(help="Record poses, transforms, status and loops too.")] = True,
    compression: Compression = "zstd",
    overwrite: Annotated[bool, typer.Option(help="Replace OUTPUT if it exists.")] = False,
    connect: Connect = None,
    listen: Listen = None,
    mode: Mode = None,
    config: Config = None,
) -> None:
    """Record frames, calibration, truth and estimates of a device until its source ends or Ctrl-C.

    Behind the end of the source it waits for the odometry's last words: until that is gone, or has had nothing to do
    for five seconds. A source that is started again by then goes on in the same file. Motion capture may go on without.
    The bytes of the wire go into the file as they are. A recorded source waits for this recorder: nothing is lost.
    It grows as OUTPUT.part, which becomes OUTPUT at the end. After a crash it lacks at most the last half second:
    `odom recover OUTPUT.part OUT.mcap`. With {time} in its name a supervisor may start it again, even within the same
    second. Exit status 1, and no file, when no message came.

    Example: odom record session.mcap
    """
    from odom.errors import OdomError
    from odom.service.progress import counting, is_in_a_run
    from odom.wire import Topics
    from odom.wire.allocator import give_back_large_blocks
    from odom.wire.recorder import Recorder
    from odom.wire.recording import RecordingWriter
    from odom.wire.session import open_session

    check_recording_name(output)
    give_back_large_blocks()
    stop = signals.stop_event()
    target = timed(output)
    settings = wire_settings(config, connect, listen, mode, namespace)
    topics = Topics(settings.namespace)
    metadata = {"namespace": topics.namespace}
    with (
        RecordingWriter(target, compression, overwrite, metadata, beside=target != output) as writer,
        open_session(settings) as session,
        counting("record", None) as progress,
    ):
        _LOG.info("recording to %s, which becomes %s at the end", writer.part, writer.path)
        report = Recorder(session, topics, writer, estimates).run(stop, progress)
        if not writer.count:
            ask = "; is its sensor up, with the same --namespace, and do --connect and --listen lead to each other?"
            raise OdomError(f"no message came for {topics.namespace}, nothing is written{'' if is_in_a_run() else ask}")
    missing = f", {report.lost} lost on the way" if report.lost else ""
    typer.echo(
        f"{writer.path}: {report.frames} frames, {writer.count} messages{missing}, "
        f"{writer.path.stat().st_size / 1e6:.1f} MB; {report.reason}"
    )
