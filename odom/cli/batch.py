"""`odom batch FOLDER|FILES...`: many recordings, each done once."""

import os
from pathlib import Path
from typing import Annotated

import typer

from odom.cli import options, signals
from odom.cli.outputs import check_place


def batch(
    recordings: Annotated[list[Path], typer.Argument(help="Recordings, or folders that hold some.")],
    out: Annotated[Path, options.out_folder("Folder of results/ and of summary.csv, .json and .html.")],
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Recordings at a time on this machine; default half of the cores.")
    ] = None,
    shard: Annotated[
        str | None, typer.Option(help="Do only part i of n, as in 0/8, and write no summary (see examples).")
    ] = None,
    dask: Annotated[str | None, typer.Option(help="Run on the Dask cluster of this scheduler.")] = None,
    baseline: Annotated[Path | None, typer.Option(help="Another batch's folder: say what got better or worse.")] = None,
    camera: options.Calibration = None,
    start: options.Start = 0.0,
    end: options.End = None,
    topic: options.OwnTopics = None,
    option: options.SourceOption = None,
    config: options.Config = None,
) -> None:
    """Run `odom run` on every recording, and write one table of how they went.

    Results are kept by a hash of recording, settings and version: what is done is not done again, whoever is killed.
    Exit status 1 when a recording failed; those are tried again by the next call.

    Example: odom batch recordings --out out/all --jobs 2

    Example: odom batch walks --out out/all --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT"
    """
    stop = signals.stop_event()
    from odom.batch.content_hashes import ContentHashes
    from odom.batch.fleet import run_here, run_on_dask
    from odom.batch.job import Job, plan_jobs, shard_of
    from odom.batch.recordings import find_recordings
    from odom.batch.summary import rows_of, totals_of
    from odom.batch.summary_files import read_rows, write_summary
    from odom.batch.worker import INTERRUPTED
    from odom.errors import ConfigError, OdomError
    from odom.service.progress import counting
    from odom.service.settings import load_settings

    if dask is not None and jobs is not None:
        raise ConfigError("--jobs is for this machine: a Dask cluster has as many workers as it was started with")
    if end is not None and end <= start:
        raise ConfigError(f"--end {end:g} is not behind --start {start:g}, and both count from the beginning")
    if camera is not None and not camera.is_file():
        raise ConfigError(f"calibration {camera} cannot be read: there is no such file")
    check_place("--out", out / "results")
    before = read_rows(baseline) if baseline is not None else []
    settings = options.with_mask(load_settings(config), None)
    chosen = shard_of(find_recordings(recordings), shard)
    arguments: list[tuple[str, Path | float | str]] = [("start", start)] if start else []
    arguments += [("end", end)] if end is not None else []
    arguments += [("camera", camera.resolve())] if camera is not None else []
    arguments += [("mask", settings.service.mask.resolve())] if settings.service.mask is not None else []
    arguments += [*(("topic", one) for one in topic or ()), *(("option", one) for one in option or ())]
    results = out.resolve() / "results"
    results.mkdir(parents=True, exist_ok=True)
    with counting("hashing", None, unit="MB") as progress:
        hashes = ContentHashes(out, progress, stop.is_set)
        try:
            planned = plan_jobs(chosen, hashes, settings.odometry.model_dump(mode="json"), arguments, results)
        finally:
            hashes.save()
    due = list({job.key: job for job in planned if not job.is_done}.values())
    failures: dict[str, str] = {}
    with counting("batch", len(due), unit="recordings") as progress:

        def done(job: Job, why: str) -> None:
            if why and why != INTERRUPTED:
                failures.update({each.name: f"failed: {why}" for each in planned if each.key == job.key})
            progress(sum(each.is_done for each in due))

        if due and dask is not None:
            run_on_dask(due, dask, stop, done)
        elif due:
            run_here(due, jobs or max(1, (os.cpu_count() or 1) // 2), stop, done)
    for name, why in sorted(failures.items()):
        typer.echo(f"{name}: {why}", err=True)
    rows = rows_of(planned, failures, before)
    for row in rows:
        if row["source_damage"]:
            typer.echo(f"{row['name']}: done, but its source is damaged: {row['source_damage']}", err=True)
    count = sum(job.is_done for job in planned)
    typer.echo(f"{count} of {len(planned)} recordings done, {len(due)} of them were due")
    if shard is None:
        write_summary(out, rows)
        changes = [f"{n} {word}" for word, n in totals_of(rows).items() if word in ("better", "worse", "mixed") and n]
        typer.echo(f"table: {out / 'summary.html'}{' (' + ', '.join(changes) + ')' if changes else ''}")
    if failures:
        raise OdomError(f"{len(failures)} of {len(planned)} recordings failed; the next call tries them again")
    if count < len(planned):
        raise OdomError(f"{len(planned) - count} of {len(planned)} recordings are not done; the next call does them")
