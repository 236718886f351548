"""`odom bench`: measure what can be measured, beside what is possible."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from odom.cli import signals
from odom.cli.bench_physical import physical
from odom.cli.bench_pipeline import pipeline
from odom.cli.bench_robustness import robustness
from odom.cli.options import Calibration, Config
from odom.cli.outputs import check_files, write_json
from odom.errors import writing_to

if TYPE_CHECKING:
    from rich.console import Console

    from odom.evaluation.paper.benchmark import Row
    from odom.evaluation.paper.cost import Cost

bench = typer.Typer(help="Measure accuracy and cost.", no_args_is_help=True)
bench.command("robustness")(robustness)
bench.command("physical")(physical)
bench.command("pipeline")(pipeline)


@bench.command("registration")
def registration(
    clouds: Annotated[int, typer.Option(min=2, help="Clouds a scenario.")] = 100,
    full: Annotated[bool, typer.Option("--full", help="1000 clouds a scenario, as the paper.")] = False,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write all figures to this file.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Write the picture of RMSE and time to this .png.")] = None,
) -> None:
    """Run the paper's synthetic scenarios for its five estimators, beside the Cramer-Rao bound.

    Then cases with wrong assumptions and wrong pairs, and the cost against Horn's closed form. All
    estimators see the same seeded clouds of 400 pairs.

    Example: odom bench registration --json table.json --plot table.png
    """
    import sys
    from dataclasses import asdict

    from rich.console import Console
    from rich.progress import track

    from odom.evaluation.paper import benchmark, cost, scenarios
    from odom.registration import warm_up

    check_files(json_file, plot)
    console = Console(width=None if sys.stdout.isatty() else 190)
    clouds = 1000 if full else clouds
    warm_up()
    for _ in benchmark.stress_cases(2):  # compiles and loads what the first timed call would
        pass
    table: list[Row] = []
    for group, count in (
        (benchmark.paper_scenarios, 20),
        (benchmark.stress_cases, len(scenarios.STRESS)),
        (benchmark.without_correspondences, 1),
        (benchmark.outlier_ratios, len(benchmark.OUTLIER_RATIOS)),
    ):
        begun = len(table)
        label = f"{clouds} clouds a scenario"
        for found in track(
            group(clouds), label, total=count, console=console, transient=True, disable=not console.is_terminal
        ):
            table += found
        _print_rows(console, table[begun:])
    costs = cost.costs() + cost.growth()
    _print_costs(console, costs)
    if json_file is not None:
        everything = {"clouds": clouds, "rows": [asdict(row) for row in table], "costs": [asdict(c) for c in costs]}
        write_json(json_file, everything, indent=1)
    if plot is not None:
        from odom.evaluation.paper.figure import plot as draw

        with writing_to(plot):
            draw(table, plot)


@bench.command("sensitivity")
def sensitivity(
    sources: Annotated[
        list[str], typer.Argument(metavar="SOURCE...", help="Recordings or folders of images with truth.")
    ],
    only: Annotated[
        list[str] | None, typer.Option(metavar="GLOB", help="Only numbers of this name, as frontend.*_px; repeat.")
    ] = None,
    factor: Annotated[float, typer.Option(min=1.01, help="What numbers are divided and multiplied by.")] = 2.0,
    seconds: Annotated[float | None, typer.Option(min=1, help="Only so much of each source, from its start.")] = None,
    spoil: Annotated[
        list[str] | None,
        typer.Option("--spoilt", metavar="AXIS=LEVEL", help="Run over the first source spoilt like this, too; repeat."),
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Processes at a time.")] = 1,
    camera: Calibration = None,
    config: Config = None,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write all figures to this file.")] = None,
    markdown_file: Annotated[Path | None, typer.Option("--markdown", help="Write the table to this file.")] = None,
) -> None:
    """Make each tuned number of the algorithms half and twice as large and print what that does.

    That is to ATE and NEES, and to the shares of frames that are tracked, LOST, or TRACKING and wrong (as `odom bench
    robustness` counts them). Guards against people, darkness or gaps act where the source is --spoilt by them.

    Each value is run over all sources in a process of its own, which takes hours for all numbers. NEES is the mean
    over one second, 6 being ideal. On a recording of seconds any change at all moves the ATE by some 10 %, by chance.
    Ctrl-C ends it with the numbers measured so far.

    Example: odom bench sensitivity tum_fr1_xyz session.mcap --only 'frontend.*' --seconds 8 --spoilt passers-by=.33
    """
    import sys

    from rich.console import Console
    from rich.table import Table

    from odom.bench.robustness_run import Task
    from odom.bench.sensitivity_bench import measure_sensitivity, spoilt
    from odom.errors import ConfigError
    from odom.evaluation.sensitivity import COLUMNS, as_json, cells, changes, markdown, tuned_numbers
    from odom.service.progress import counting
    from sensors.catalogue import check_source
    from sensors.source import SourceOptions

    stop = signals.stop_event()
    check_files(json_file, table=markdown_file)
    numbers = tuned_numbers(*only or (), factor=factor)
    if not numbers:
        raise ConfigError(f"no tuned number is called {' or '.join(only or ())}: without --only all of them are tried")
    for source in sources:
        check_source(source, SourceOptions(camera=camera))
    files = [None if path is None else str(path) for path in (camera, config)]
    tasks = [Task(source, "", 1, seconds, files[0], files[1]) for source in sources]
    tasks += [spoilt(tasks[0], text) for text in spoil or ()]
    with counting("measured", 1 + sum(len(changes(number)) for number in numbers), "values") as progress:
        found = measure_sensitivity(numbers, tasks, jobs, progress, stop.is_set)
    console = Console(width=None if sys.stdout.isatty() else 200)
    table = Table(
        title=f"divided and multiplied by {factor:g}: {len(found)} of {len(numbers)} numbers", title_justify="left"
    )
    for column in COLUMNS:
        table.add_column(column, overflow="fold")
    for row in cells(found):
        table.add_row(*row)
    console.print(table)
    if json_file is not None:
        write_json(json_file, as_json(found), indent=1)
    if markdown_file is not None:
        with writing_to(markdown_file):
            markdown_file.write_text(markdown(found))


def _print_rows(console: "Console", table: "list[Row]") -> None:
    """Print the rows of one group, a block a scenario."""
    from rich.table import Table

    shown = Table(title=f"{table[0].group}: {table[0].clouds} clouds of 400 pairs a scenario", title_justify="left")
    for name in (
        "scenario", "estimator", "RMSE\nmm", "bound\nmm", "RMSE /\nbound", "to noisy\nmm", "rotation\ndeg",
        "transl.\nmm", "NEES\n(6)", "time\nms", "no\npose", "beyond\n5 sigma", "paper\nmm",
    ):  # fmt: skip
        shown.add_column(name, justify="left" if name in ("scenario", "estimator") else "right", overflow="fold")
    last = ""
    for row in table:
        if last and row.scenario != last:
            shown.add_section()
        shown.add_row(
            row.scenario if row.scenario != last else "",
            row.estimator,
            f"{row.rmse_mm:.4g}",
            f"{row.bound_mm:.4g}",
            f"{row.rmse_mm / row.bound_mm:.3g}",
            f"{row.rmse_noisy_mm:.4g}",
            f"{row.rotation_deg:.3g}",
            f"{row.translation_mm:.3g}",
            f"{row.nees:.3g}",
            f"{row.time_ms:.3f}",
            str(row.degenerate),
            str(row.confidently_wrong),
            "" if row.paper_mm is None else f"{row.paper_mm:g}",
        )
        last = row.scenario
    console.print(shown)


def _print_costs(console: "Console", costs: "list[Cost]") -> None:
    """Print what a registration costs against Horn's closed form."""
    from rich.table import Table

    shown = Table(title="cost: medians of CPU time, taking turns, one thread", title_justify="left")
    for name in ("what", "pairs", "CPU\nms", "against\nHorn", "us a\npair"):
        shown.add_column(name, justify="left" if name == "what" else "right")
    for cost in costs:
        per_pair = 1e3 * cost.time_ms / cost.pairs
        shown.add_row(cost.what, str(cost.pairs), f"{cost.time_ms:.3f}", f"{cost.ratio_to_horn:.2f}", f"{per_pair:.3f}")
    console.print(shown)
