"""`odom map`: what is in a map that outlives its runs, whether it is whole, and its trajectories."""

from pathlib import Path
from typing import Annotated

import typer

from odom.errors import ConfigError, OdomError

map_ = typer.Typer(help="Maps that outlive a run: look into them, check and mend them.", no_args_is_help=True)
MapName = Annotated[Path, typer.Argument(help="A map that `odom run SOURCE --map FILE` has made.")]


@map_.command("info")
def info(file: MapName) -> None:
    """Say what a map holds: sessions, key frames, parts and extent.

    Example: odom map info lab.map
    """
    from odom.map_file.map_file import MapFile
    from odom.map_file.summary import lines_of

    opened = MapFile(file, is_written=False)
    try:
        for line in lines_of(opened):
            typer.echo(line)
    finally:
        opened.close()


@map_.command("check")
def check(
    file: MapName,
    mend: Annotated[Path | None, typer.Option(help="Write all that is whole to this new map.")] = None,
) -> None:
    """Read all of a map and say what is damaged. Exit status 1 when something is.

    Example: odom map check lab.map --mend mended.map
    """
    from odom.map_file.database import connect, damage_told
    from odom.map_file.rebuild import look_through, write_rest

    if mend is not None and mend.resolve() == file.resolve():
        raise ConfigError("--mend needs another name: a damaged map is not written to")
    with damage_told(file):
        db = connect(file, is_written=False)
        try:
            found = look_through(db)
            for what in found.damage:
                typer.echo(f"damaged: {what}")
            if mend is not None:
                write_rest(db, found, mend)
                typer.echo(f"{mend}: {len(found.keyframes.keys() & found.details)} key frames saved")
        finally:
            db.close()
    if found.damage and mend is None:
        raise OdomError(f"{file} is damaged: `odom map check {file} --mend NEW.map` saves what is whole")
    if not found.damage:
        typer.echo(f"{file}: {len(found.keyframes)} key frames, all whole")


@map_.command("export")
def export(
    file: MapName, out: Annotated[Path, typer.Option(help="Folder for the files; made where there is none.")]
) -> None:
    """Write each session's key frames as a trajectory (session-N.txt, TUM), and the landmarks (landmarks.ply).

    Poses are in the map's coordinates, so that sessions can be compared; parts of a map that were never joined have
    coordinates of their own, and are marked by `# segment N`.

    Example: odom map export lab.map --out out/lab
    """
    from odom.map_file.map_file import MapFile
    from odom.map_file.summary import write_files

    opened = MapFile(file, is_written=False)
    try:
        for path in write_files(opened, out):
            typer.echo(str(path))
    finally:
        opened.close()
