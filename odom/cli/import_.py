"""`odom import FOLDER OUT.mcap`: a folder of images as a recording."""

import os
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from odom.cli import signals
from odom.cli.options import Calibration, Compression, OwnTopics, SourceOption, pairs
from odom.cli.outputs import check_not_read, check_recording_name


def import_(
    source: Annotated[str, typer.Argument(help="A folder of images, or any SOURCE that is not live.")],
    output: Annotated[Path, typer.Argument(help="The .mcap recording to write.")],
    camera: Calibration = None,
    namespace: Annotated[str, typer.Option(help="Name of the device, first part of its topics.")] = "cam0",
    start: Annotated[float, typer.Option(min=0, help="Seconds to skip.")] = 0.0,
    end: Annotated[float | None, typer.Option(min=0, help="Seconds from the beginning to stop at.")] = None,
    compression: Compression = "zstd",
    topic: OwnTopics = None,
    option: SourceOption = None,
    overwrite: Annotated[bool, typer.Option(help="Replace OUTPUT if it exists.")] = False,
) -> None:
    """Turn a folder of images into an MCAP recording: colour files byte for byte, depth lossless, truth with it.

    Exit status 1, and no file, when no image of colour, or none of depth, can be used.

    Example: odom import rgbd_dataset_freiburg1_xyz xyz.mcap --camera camera.yaml
    """
    import cv2

    from odom.errors import RecordingError, SourceError
    from odom.service.progress import counting
    from odom.wire import Topics
    from odom.wire.recording import RecordingWriter
    from sensors.catalogue import open_source
    from sensors.needed_images import NeededImages
    from sensors.source import SourceOptions

    check_recording_name(output)
    cv2.setNumThreads(1)
    stop = signals.stop_event()
    topics = Topics(namespace)
    options = SourceOptions(
        topics=topics,
        camera=camera,
        start=start,
        end=end,
        topics_from=pairs("--topic", topic),
        extra=pairs("--option", option),
    )
    frames, seen = 0, set[str]()
    with closing(NeededImages(source, open_source(source, options), topics)) as opened:
        if not opened.lossless:
            raise RecordingError(f"{source} is live: record it with `odom sensor {source}` and `odom record {output}`")
        check_not_read(source, output)
        name = os.fsencode(Path(source).name).decode(errors="replace")
        with (
            RecordingWriter(output, compression, overwrite, {"source": name}) as writer,
            counting("import", opened.length) as progress,
        ):
            try:
                for message in opened.messages():
                    writer.write(message)
                    frames += message.topic in topics.color_keys
                    seen.add(message.topic)
                    progress(frames)
                    if stop.is_set():
                        break
                if not (frames or stop.is_set() or source.endswith(".csv")):  # Motive's are of truth alone
                    raise SourceError(
                        f"{source}: no colour image came: `odom doctor {source}` says what it holds; --start may be "
                        "behind its end"
                    )
            except SourceError:
                if any(seen.isdisjoint(keys) for keys in (topics.color_keys, topics.depth_keys)):
                    writer.drop()
                raise
            if stop.is_set() and output.exists():
                raise RecordingError(f"interrupted: {output} stays as it was")
    ended = " (interrupted)" if stop.is_set() else ""
    typer.echo(f"{output}: {frames} frames, {writer.count} messages, {output.stat().st_size / 1e6:.1f} MB{ended}")
