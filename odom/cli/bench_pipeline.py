"""`odom bench pipeline`: what a frame costs, stage by stage, and beside an earlier measurement."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from odom.cli import signals
from odom.cli.options import Calibration, Config, End, Seconds, Seed, SourceName, Start
from odom.cli.outputs import check_files, write_json

if TYPE_CHECKING:
    from rich.console import Console

    from odom.bench.pipeline_bench import PipelineCost
    from odom.evaluation.paired_costs import CostChange


def pipeline(
    source: SourceName,
    camera: Calibration = None,
    start: Start = 0.0,
    end: End = None,
    frames: Annotated[int | None, typer.Option(min=1, help="Stop after so many frames.")] = None,
    seconds: Seconds = None,
    seed: Seed = 1,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write all figures to this file.")] = None,
    against: Annotated[
        Path | None, typer.Option(help="Compare with the figures in this file, of an earlier --json, frame by frame.")
    ] = None,
    config: Config = None,
) -> None:
    """Print what a frame costs, stage by stage: decoding and odometry in one process, without a wire.

    The source's own work (reading files, drawing the arena) is in no figure; a stage that a frame did not pass through
    counts 0 for it. Made-up frames warm the process up first. Beside it stands the floor: decoding, and following 400
    corners from image to image by OpenCV. Machines change speed: what following took in both measurements says by how
    much. Ctrl-C ends it with the figures of the frames so far.

    Example: odom bench pipeline session.mcap --json cost.json --against before.json
    """
    import sys
    from dataclasses import asdict

    from rich.console import Console

    from odom.bench.pipeline_bench import measure_pipeline
    from odom.bench.pipeline_comparison import compared, read_cost
    from odom.service.progress import counting
    from odom.service.settings import load_settings
    from odom.service.startup import warm_up
    from odom.wire import Topics
    from sensors.catalogue import open_source
    from sensors.source import SourceOptions

    check_files(json_file)
    before = None if against is None else read_cost(against)
    stop = signals.stop_event()
    topics, settings = Topics(), load_settings(config).odometry
    options = SourceOptions(topics=topics, camera=camera, start=start, end=end, seconds=seconds, seed=seed)
    opened = open_source(source, options)
    warm_up(settings, topics)
    with counting("measured", frames or opened.length) as progress:
        cost = measure_pipeline(opened, topics, settings, frames, progress, stop.is_set)
    console = Console(width=None if sys.stdout.isatty() else 120)
    _print_stages(console, source, cost)
    if json_file is not None:
        write_json(json_file, {"source": source, **asdict(cost)})
    if before is not None:
        _print_changes(console, compared(before, cost), before.follow_ms, cost.follow_ms)


def _print_stages(console: "Console", source: str, cost: "PipelineCost") -> None:
    """Print the cost of each stage, and below it what all of them cost together."""
    from rich.table import Table

    from odom.bench.pipeline_bench import ODOMETRY

    shown = Table(title=f"{source}: {cost.frames} frames, wall ms a frame", title_justify="left")
    for name in ("stage", "mean", "p50", "p95", "p99"):
        shown.add_column(name, justify="left" if name == "stage" else "right")
    for stage in cost.stages:
        if stage.stage == ODOMETRY:
            shown.add_section()
        values = (stage.mean_ms, stage.p50_ms, stage.p95_ms, stage.p99_ms)
        shown.add_row(stage.stage, *(f"{value:.2f}" for value in values))
    console.print(shown)
    console.print(
        f"{cost.frames_a_second:.1f} frames/s; CPU {cost.cpu_ms_a_frame:.2f} ms a frame, "
        f"{cost.background_ms_a_frame:.2f} of it in the background; final adjustment {cost.finish_s:.2f} s"
    )
    if cost.floor_ms is not None:
        share = cost.floor_ms / cost.stages[-1].mean_ms
        console.print(
            f"the floor, decoding and following 400 corners, is {cost.floor_ms:.2f} ms: {share:.0%} of the total"
        )


def _print_changes(
    console: "Console", changes: "Sequence[CostChange]", follow_before_ms: float | None, follow_now_ms: float | None
) -> None:
    """Print how each stage's cost changed, and how the machine's speed did."""
    from rich.table import Table

    shown = Table(title="the same frames before and now", title_justify="left")
    for name in ("stage", "before\np50 ms", "now\np50 ms", "now /\nbefore", "95 %"):
        shown.add_column(name, justify="left" if name == "stage" else "right")
    for change in changes:
        ratio, between = "", ""  # too few frames passed the stage
        if not math.isnan(change.ratio):
            ratio, between = f"{change.ratio:.3f}", f"{change.low:.3f} .. {change.high:.3f}"
        shown.add_row(change.stage, f"{change.before_ms:.2f}", f"{change.now_ms:.2f}", ratio, between)
    console.print(shown)
    if follow_before_ms is not None and follow_now_ms is not None:
        machine = follow_now_ms / follow_before_ms
        total = next(change for change in reversed(changes) if change.stage == "total")
        console.print(
            f"following 400 corners took {machine:.3f} times what it took before: at the machine's speed of then "
            f"the total is {total.ratio / machine:.3f}"
        )
