"""`odom mask SOURCE --out FILE`: what of the image shows the camera's carrier."""

from pathlib import Path
from typing import Annotated

import typer

from odom.cli import signals
from odom.cli.options import Calibration, OwnTopics, SourceName, SourceOption, Start, pairs
from odom.cli.outputs import check_place
from odom.errors import writing_to


def mask(
    source: SourceName,
    out: Annotated[Path, typer.Option(help="Image to write: white where the camera sees what carries it.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")] = False,
    seconds: Annotated[float, typer.Option(min=1, max=30, help="How much of the source to look at.")] = 30.0,
    start: Start = 0.0,
    camera: Calibration = None,
    topic: OwnTopics = None,
    option: SourceOption = None,
) -> None:
    """Find what of SOURCE's images stays the same wherever the camera goes: a robot's deck, a rig, a helmet's edge.

    Give the image that it writes to `odom run`, `serve`, `export`, `calibrate` and `doctor` as --mask, so that none of
    them takes it for the scene. Turn and move the camera meanwhile; look at the image, and paint it as you
    like. Exit status 1 when nothing stays the same.

    Example: odom mask walk.mcap --out mask.png
    """
    from odom.errors import ConfigError, InputError
    from odom.evaluation.diagnosis.fixed_parts import NOT_SHOWN, fixed_parts
    from odom.service.mask_file import write_mask
    from odom.service.source_sample import look_at
    from sensors.catalogue import check_images, open_source
    from sensors.source import SourceOptions

    check_images(source)
    if out.exists() and not overwrite:
        raise ConfigError(f"{out}: there already; give --overwrite or another --out")
    check_place("--out", out)
    stop = signals.stop_event()
    options = SourceOptions(
        camera=camera, start=start, topics_from=pairs("--topic", topic), extra=pairs("--option", option)
    )
    recording = look_at(open_source(source, options), options.topics, seconds, stop.is_set)
    if not recording.frames:
        raise InputError(f"{source}: no frame came: look at it with odom doctor")
    found = fixed_parts([frame.color for frame in recording.frames])
    if not found.are_known:
        raise InputError(f"{source}: {NOT_SHOWN}; record while it moves and turns")
    if not found.mask.any():
        typer.echo(f"{source}: nothing stays the same wherever the camera goes; no mask is needed, none is written")
        raise typer.Exit(1)
    with writing_to(out):
        write_mask(out, found.mask)
    typer.echo(f"{out}: {found.share:.0%} of the image stays the same in {found.looks} looks; give --mask {out}")
