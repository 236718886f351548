"""`odom recover IN OUT`: a sound recording from a cut or damaged one."""

from pathlib import Path
from typing import Annotated

import typer


def recover(
    damaged: Annotated[Path, typer.Argument(help="The recording that was cut by a crash or is damaged.")],
    output: Annotated[Path, typer.Argument(help="The recording to write.")],
    overwrite: Annotated[bool, typer.Option(help="Replace OUTPUT if it exists.")] = False,
) -> None:
    """Copy every whole message of a cut or damaged MCAP recording into a sound one with an index.

    Example: odom recover crashed.mcap mended.mcap
    """
    from odom.wire.recording import recover as mend

    count, damage = mend(damaged, output, overwrite)
    for what in damage or ("the recording was sound",):
        typer.echo(f"{damaged}: {what}")
    typer.echo(f"{output}: {count} messages saved")
