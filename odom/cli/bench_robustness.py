"""`odom bench robustness`: how far a recording may be spoilt before the odometry fails, and whether it says so."""

from pathlib import Path
from typing import Annotated

import typer

from odom.cli import signals
from odom.cli.options import Calibration, Config, End, out_folder
from odom.cli.outputs import write_json


def robustness(
    source: Annotated[str, typer.Argument(help="A recording or folder of images with truth.")],
    axis: Annotated[list[str] | None, typer.Option(help="Only this axis; may be given again.")] = None,
    out: Annotated[Path | None, out_folder("Write table.md, robustness.json and .png here.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all chance.")] = 1,
    end: End = None,
    camera: Calibration = None,
    jobs: Annotated[int, typer.Option(min=1, help="Processes at a time, each on one thread.")] = 2,
    config: Config = None,
) -> None:
    """Spoil a recording in ever harder ways and print what that does to the odometry.

    Frames are blurred, darkened, dropped, stamped wrongly and so on; each level runs in a process of its own. Beside
    accuracy it says how many frames were TRACKING and wrong: off by more than 5 cm or 3 deg over a second, and outside
    the 99.9 % bound of their own covariance. Ctrl-C ends it with the levels measured so far.

    Example: odom bench robustness tum_fr1_xyz --axis darkness --axis dropped --out robustness
    """
    import sys

    from rich.console import Console
    from rich.table import Table

    from odom.bench.robustness_bench import check_source, chosen_axes, measure_robustness
    from odom.bench.robustness_run import Task
    from odom.evaluation.robustness.outcomes import COLUMNS, as_json, markdown, rows, short_markdown
    from odom.service.progress import counting

    stop = signals.stop_event()
    axes = chosen_axes(axis or ())
    check_source(source, camera, end)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
    calibration, settings = (None if path is None else str(path) for path in (camera, config))
    task = Task(source, "", seed, end, calibration, settings)
    with counting("measured", 1 + sum(len(one.levels) for one in axes), "runs") as progress:
        found = measure_robustness(axes, task, jobs, progress, stop.is_set)
    table = Table(title=f"{source}, spoilt", title_justify="left")
    for column in COLUMNS:
        table.add_column(column, overflow="fold")
    for row in rows(found):
        table.add_row(*row, end_section=row[-1] == "" and row[0] == "nothing")
    console = Console(width=None if sys.stdout.isatty() else 160)
    console.print(table)
    console.print(
        f"{found.runs} runs of {found.unspoilt.frames} frames, {jobs} at a time, in {found.wall_s / 60:.1f} min; "
        f"CPU {found.cpu_s / 60:.1f} min"
    )
    if out is not None:
        from odom.errors import writing_to
        from odom.evaluation.robustness.figure import plot

        write_json(out / "robustness.json", as_json(found), indent=1)
        with writing_to(out / "table.md"):
            (out / "table.md").write_text(f"{short_markdown(found)}\n{markdown(found)}")
        with writing_to(out / "robustness.png"):
            plot(found, out / "robustness.png")
