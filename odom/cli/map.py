"""`odom map`: lists, checks, merges and prunes the maps that runs have saved."""

from contextlib import ExitStack, closing
from pathlib import Path
from typing import Annotated

import typer

from odom.cli import signals
from odom.cli.options import out_folder
from odom.cli.outputs import check_place
from odom.errors import ConfigError, OdomError

map_ = typer.Typer(help="Maps that outlive a run: look into them, mend, merge and prune them.", no_args_is_help=True)
MapName = Annotated[Path, typer.Argument(help="A map that `odom run SOURCE --map FILE` has made.")]


@map_.callback()
def interrupted_cleanly(context: typer.Context) -> None:
    """Clean up what was begun, however the command is asked to end."""
    context.with_resource(signals.as_ctrl_c())


@map_.command("info")
def info(file: MapName) -> None:
    """Say what a map holds: sessions, key frames, parts and extent.

    Example: odom map info lab.map
    """
    from odom.map_file.map_file import MapFile
    from odom.map_file.summary import lines_of

    with closing(MapFile(file, is_written=False)) as opened:
        for line in lines_of(opened):
            typer.echo(line)


@map_.command("check")
def check(
    file: MapName,
    mend: Annotated[Path | None, typer.Option(help="Write all that is whole to this new map.")] = None,
) -> None:
    """Read all of a map and say what is damaged. Exit status 1 when something is.

    Example: odom map check lab.map --mend mended.map
    """
    from odom.map_file.database import connect, raising_map_errors
    from odom.map_file.map_file import MapFile
    from odom.map_file.rebuild import read_all_rows, write_rest

    if mend is not None and mend.resolve() == file.resolve():
        raise ConfigError("--mend needs another name: a damaged map is not written to")
    with raising_map_errors(file), closing(connect(file, is_written=False)) as db:
        found = read_all_rows(db)
    for what in found.damage:
        typer.echo(f"damaged: {what}")
    if mend is not None:
        with closing(MapFile(file, is_written=False)) as opened:
            typer.echo(f"{mend}: {write_rest(opened, found, mend)} key frames saved")
    if found.damage and mend is None:
        raise OdomError(f"{file} is damaged: `odom map check {file} --mend NEW.map` saves what is whole")
    if not found.damage:
        typer.echo(f"{file}: {len(found.keyframes)} key frames, all whole")


@map_.command("export")
def export(file: MapName, out: Annotated[Path, out_folder("Folder for the files; made where there is none.")]) -> None:
    """Write each session's key frames as a trajectory (session-N.txt, TUM), and the landmarks (landmarks.ply).

    Poses are in the map's coordinates, so that sessions can be compared; parts of a map that were never joined have
    coordinates of their own, and are marked by `# segment N`.

    Example: odom map export lab.map --out out/lab
    """
    from odom.map_file.map_file import MapFile
    from odom.map_file.summary import write_files

    check_place("--out", out / "landmarks.ply")
    with closing(MapFile(file, is_written=False)) as opened:
        for path in write_files(opened, out):
            typer.echo(str(path))


@map_.command("merge")
def merge(
    files: Annotated[list[Path], typer.Argument(help="Maps that `odom run SOURCE --map FILE` has made, two or more.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Name of the new map.")],
) -> None:
    """Make one map of several: sessions of other days, by one camera, in any order.

    Places of each are looked up in the others; what several recognitions agree on joins them, and all key frames are
    adjusted. Maps that share no place stay parts side by side. The maps themselves stay as they are. Of what they have
    learnt of the camera's timing and noise, the newest session's is kept.

    Example: odom map merge monday.map tuesday.map -o lab.map
    """
    from odom.map_file.map_file import MapFile
    from odom.map_file.merging import merge as merge_maps
    from odom.map_file.summary import lines_of

    with ExitStack() as open_files:
        opened = [open_files.enter_context(closing(MapFile(file, is_written=False))) for file in files]
        joined = merge_maps(opened, out)
        made = open_files.enter_context(closing(MapFile(out, is_written=False)))
        for line in lines_of(made):
            typer.echo(line)
        parts = len({k.segment for k in made.keyframes()})
    typer.echo(f"{len(joined.closures)} recognitions join sessions, {joined.refused} were refused")
    if parts > 1:
        typer.echo(f"{parts} parts share no place that was recognised: each has coordinates of its own")


@map_.command("prune")
def prune(
    file: MapName,
    out: Annotated[Path, typer.Option("-o", "--out", help="Name of the new map.")],
    keyframes: Annotated[int, typer.Option(min=1, help="Key frames to keep.")],
) -> None:
    """Make a smaller map: of key frames that see the same, those that say most stay.

    Landmarks and registrations of those that go are handed on, so that nothing falls apart. The map itself stays as it
    is.

    Example: odom map prune lab.map -o small.map --keyframes 100
    """
    from odom.map_file.map_file import MapFile
    from odom.map_file.pruned import prune as prune_map
    from odom.map_file.summary import lines_of

    with closing(MapFile(file, is_written=False)) as opened:
        prune_map(opened, out, keyframes)
    with closing(MapFile(out, is_written=False)) as made:
        for line in lines_of(made):
            typer.echo(line)
