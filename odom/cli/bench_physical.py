"""`odom bench physical`: the paper's experiment with two Kinects, or with any recording that has truth."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from odom.cli import signals
from odom.cli.options import Calibration, Config
from odom.cli.outputs import check_files, write_json
from odom.errors import writing_to

if TYPE_CHECKING:
    from rich.console import Console

    from odom.bench.physical_bench import Experiment


def physical(
    source: Annotated[str, typer.Argument(help="arena, or a recording or folder of images with truth.")] = "arena",
    pairs: Annotated[int, typer.Option(min=2, max=1000, help="Pairs of clouds (C_i, C_i+1), evenly spread.")] = 120,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the arena and of all chance.")] = 1,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write all figures to this file.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Write Figure 1 to this .png.")] = None,
    camera: Calibration = None,
    jobs: Annotated[int, typer.Option(min=1, help="Processes at a time, each on one thread.")] = 2,
    config: Config = None,
) -> None:
    """Register pairs of clouds by five estimators, with correspondences of three front-ends, and judge them by truth.

    Without SOURCE, a newer and an older simulated Kinect are walked along an infinity in the simulated laboratory. The
    front-ends: corners followed from frame to frame, ORB, and SIFT3D with CSHOT. The estimators get the pairs as they
    are and behind the gate. Then the last cloud against the first, and which wrong pairs would explain the paper's
    figures. `off` counts poses wrong by more than 5 cm or 3 deg.

    Example: odom bench physical --json physical.json --plot physical.png
    """
    import sys
    import tempfile

    from rich.console import Console

    from odom.bench.physical_bench import check_source, run_experiment
    from odom.bench.physical_run import Task
    from odom.service.progress import counting

    stop = signals.stop_event()
    check_files(json_file, plot)
    check_source(source, camera, pairs)
    calibration, settings = (None if path is None else str(path) for path in (camera, config))
    with tempfile.TemporaryDirectory() as folder:
        task = Task(source, folder, pairs, seed, camera=calibration, config=settings)
        with counting("measured", 100, "%") as progress:
            found = run_experiment(task, jobs, progress, stop.is_set)
        if plot is not None:
            _draw(found, Path(folder), plot)
    _print(Console(width=None if sys.stdout.isatty() else 160), found)
    if json_file is not None:
        write_json(json_file, found.as_json(), indent=1)


def _draw(found: "Experiment", folder: Path, path: Path) -> None:
    import cv2
    import numpy as np

    from odom.evaluation.physical.figure import plot

    last = list(found.parts)[-1]
    scene = cv2.imread(str(folder / f"scene-{last}.png"))
    picture = None if scene is None else np.asarray(cv2.cvtColor(scene, cv2.COLOR_BGR2RGB), dtype=np.uint8)
    walks = {name: np.array(part.walk_m).reshape(-1, 3) for name, part in found.parts.items()}
    with writing_to(path):
        plot(found.rows, found.parts[last].ellipsoids, picture, walks, path)


def _print(console: "Console", found: "Experiment") -> None:
    from rich.table import Table

    from odom.evaluation.physical.figure import TITLES

    for sensor, part in found.parts.items():
        shown = Table(title=f"{found.source}: {TITLES.get(sensor, sensor)}", title_justify="left")
        for name in (
            "front-end", "gate", "estimator", "RMSE\nmm", "95 %\ninterval", "median\nmm", "to mocap\nmm",
            "to noisy\nmm", "time\nms", "no\npose", "off", "paper\nmm",
        ):  # fmt: skip
            shown.add_column(name, justify="left" if name in ("front-end", "gate", "estimator") else "right")
        last = ("", False)
        for row in (row for row in found.rows if row.sensor == sensor):
            is_new = (row.front_end, row.is_gated) != last
            if is_new and last[0]:
                shown.add_section()
            about = f"{row.front_end}: {row.pairs:.0f} pairs, {100 * row.wrong:.0f} % wrong"
            shown.add_row(
                about if row.front_end != last[0] else "",
                ("yes" if row.is_gated else "no") if is_new else "",
                row.estimator,
                f"{row.rmse_mm:.4g}",
                f"{row.low_mm:.3g}..{row.high_mm:.3g}",
                f"{row.median_mm:.4g}",
                f"{row.lab_mm:.4g}",
                f"{row.noisy_mm:.4g}",
                f"{row.time_ms:.2f}",
                str(row.none),
                str(row.off),
                "" if row.paper_mm is None else f"{row.paper_mm:g}",
            )
            last = (row.front_end, row.is_gated)
        console.print(shown)
        for note in part.notes:
            console.print(note, highlight=False)
    _print_closing(console, found)
    _print_matches(console, found)
    console.print(
        f"{found.pairs} pairs a sensor in {found.wall_s / 60:.1f} min; CPU {found.cpu_s / 60:.1f} min", highlight=False
    )


def _print_closing(console: "Console", found: "Experiment") -> None:
    """Print the last cloud against the one before it and against the first, behind the gate."""
    from rich.table import Table

    shown = Table(title="the last cloud, behind the gate", title_justify="left")
    numbers = ("pairs", "wrong", "RMSE mm", "off mm", "off deg")
    for name in ("sensor", "against", "front-end", "estimator", *numbers, "no pose"):
        shown.add_column(name, justify="right" if name in numbers else "left")
    for sensor, outcomes in found.closing.items():
        for o in (o for o in outcomes if o.is_gated):
            against = "the one before" if o.number >= 0 else "the first"
            figures = ("", "", "") if o.reason else (f"{o.rmse_mm:.4g}", f"{o.error_mm:.4g}", f"{o.error_deg:.3g}")
            shown.add_row(sensor, against, o.front_end, o.estimator, str(o.pairs), str(o.wrong), *figures, o.reason)
    console.print(shown)


def _print_matches(console: "Console", found: "Experiment") -> None:
    from rich.table import Table

    title = "wrong pairs at which an ungated estimator has the paper's error, and what the others have there (mm)"
    shown = Table(title=title, title_justify="left")
    for name in ("sensor", "RMSE", "a wrong target is", "estimator", "paper mm", "share", "ungated", "gated, to truth"):
        shown.add_column(name, justify="right" if name in ("paper mm", "share") else "left", overflow="fold")

    def listed(errors: dict[str, float]) -> str:
        return ", ".join(f"{name} {error:.3g}" for name, error in errors.items())

    for m in found.matches:
        share = "never" if m.share is None else f"{m.share:.0%}"
        both = (listed(m.ungated_mm), listed(m.gated_mm))
        shown.add_row(m.sensor, m.measure, m.kind, m.estimator, f"{m.paper_mm:g}", share, *both)
    console.print(shown)
