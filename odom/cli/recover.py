"""`odom recover IN OUT`: a sound recording from a cut or damaged one."""

from pathlib import Path
from typing import Annotated

import typer

from odom.cli import signals
from odom.cli.outputs import check_recording_name


def recover(
    damaged: Annotated[Path, typer.Argument(help="The recording that was cut by a crash or is damaged.")],
    output: Annotated[Path, typer.Argument(help="The .mcap recording to write.")],
    overwrite: Annotated[bool, typer.Option(help="Replace OUTPUT if it exists.")] = False,
) -> None:
    """Copy every whole message of a cut or damaged MCAP recording into a sound one with an index.

    Ctrl-C ends it with what was copied by then.

    Example: odom recover crashed.mcap mended.mcap
    """
    from odom.service.progress import counting
    from odom.wire.recording import recover as mend

    check_recording_name(output)
    stop = signals.stop_event()
    with counting("recover", None, "messages") as progress:
        count, damage = mend(damaged, output, overwrite, progress, stop.is_set)
    for what in damage or (() if stop.is_set() else ("the recording was sound",)):
        typer.echo(f"{damaged}: {what}")
    typer.echo(f"{output}: {count} messages saved{' (interrupted)' if stop.is_set() else ''}")
