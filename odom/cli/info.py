"""`odom info FILE`: what is in a recording."""

from pathlib import Path
from typing import Annotated

import typer


def info(file: Annotated[Path, typer.Argument(help="An .mcap recording or a ROS bag.")]) -> None:
    """Say what a recording holds, which of it would be colour, depth and calibration, and what it lacks.

    Reads the whole file. Exit status 1 when nothing can be read.

    Example: odom info session.mcap
    """
    from odom.errors import ConfigError, RecordingError
    from odom.wire.codec.cdr import DIAGNOSTICS
    from odom.wire.recording import is_recording, open_reader, select_streams
    from odom.wire.recording.bag_folder import bag_folder
    from sensors.catalogue import no_source
    from sensors.folder_layouts import is_image_folder

    if is_image_folder(file):
        raise ConfigError(
            f"{file} is a folder of images, and no recording: `odom doctor {file}` looks at it, `odom import {file} "
            "OUT.mcap` makes a recording of it"
        )
    if file.is_dir() and not is_recording(file) and not any(file.glob("*.mcap")):
        raise no_source(file)
    reader = open_reader(file)
    streams = reader.streams()
    if not streams:
        raise RecordingError("; ".join((f"{file} holds no ROS 2 messages", *reader.skipped_in_words(), *reader.damage)))
    timed = [stream for stream in streams if stream.type_name != DIAGNOSTICS] or streams
    begin, end = min(stream.begin for stream in timed), max(stream.end for stream in timed)
    parts = [file] if file.is_file() else bag_folder(file).files
    megabytes = sum(part.stat().st_size for part in parts) / 1e6
    typer.echo(f"{file}: {megabytes:.1f} MB, {(end - begin) / 1e9:.2f} s from {begin / 1e9:.6f}")
    for key, value in reader.metadata.items():
        typer.echo(f"  {key}: {value}")
    width = max(len(stream.topic) for stream in streams) + 1
    for stream in streams:
        size = stream.bytes / stream.count / 1e3
        typer.echo(
            f"  /{stream.topic:<{width}} {stream.type_name:<34} {stream.count:>7}  {stream.rate:7.2f} Hz  "
            f"{size:9.2f} kB each"
        )
    try:
        roles = select_streams(streams, {}, need_calibration=False)
        typer.echo(f"colour /{roles.color.topic}, depth /{roles.depth.topic}")
        camera = roles.camera()
        if roles.camera_info is None or camera is None:
            typer.echo("no calibration: `odom run` needs --camera camera.yaml")
        else:
            typer.echo(
                f"calibration /{roles.camera_info.topic}: {camera.width} x {camera.height}, "
                f"fx {camera.fx:.2f} fy {camera.fy:.2f} cx {camera.cx:.2f} cy {camera.cy:.2f}"
            )
    except (RecordingError, ConfigError) as error:
        typer.echo(f"not a source for `odom run`: {error}")
    for skipped in reader.skipped_in_words():
        typer.echo(skipped)
    for damage in reader.damage:
        typer.echo(f"damaged: {damage}; mend it with: odom recover {file} OUT.mcap")
    if reader.complete:
        typer.echo("complete: every chunk is whole and the file is closed")
