"""`odom run SOURCE`: the main job."""

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from odom.cli import logs, options, signals


def run(
    source: options.SourceName = "arena",
    out: Annotated[
        Path | None,
        typer.Option(help="Folder of the run's files; without it one below out/ named for source and time."),
    ] = None,
    headless: Annotated[bool, typer.Option("--headless", help="Show nothing.")] = False,
    web: Annotated[bool, typer.Option("--web", help="Show the run in a browser instead of a window.")] = False,
    rrd: Annotated[bool, typer.Option("--rrd", help="Write session.rrd for Rerun; no window opens.")] = False,
    stay: Annotated[bool, typer.Option("--stay", help="Keep the viewer open until Ctrl-C.")] = False,
    record: Annotated[Path | None, typer.Option(help="Record the session to this .mcap file meanwhile.")] = None,
    chain: Annotated[bool, typer.Option("--chain", help="Also write the paper's pairwise chain to chain.txt.")] = False,
    camera: options.Calibration = None,
    start: options.Start = 0.0,
    end: options.End = None,
    realtime: Annotated[bool, typer.Option("--realtime", help="Play a recording like a live sensor.")] = False,
    rate: options.Rate = 1.0,
    live: Annotated[bool, typer.Option("--live", help="Run the arena like a live sensor.")] = False,
    seconds: options.Seconds = None,
    seed: options.Seed = 1,
    topic: options.OwnTopics = None,
    option: options.SourceOption = None,
    kind: options.SimulatedSensor = "kinect1",
    sensor_option: Annotated[
        list[str] | None, typer.Option(help="A further argument of `odom sensor`, as in --sensor-option=--depth=rvl.")
    ] = None,
    namespace: options.Namespace = None,
    config: options.Config = None,
) -> None:
    """Track a source to its end or Ctrl-C, and leave trajectory, report and plot in a folder.

    Example: odom run recordings/arena.mcap --headless --out out/first
    """
    import os

    stop = signals.stop_event()
    from odom.service.local_run import RunPlan
    from odom.service.local_run import run as run_all
    from odom.service.settings import load_settings
    from odom.service.settings_sources import CONFIG_ENVIRONMENT

    if config is not None:
        os.environ[CONFIG_ENVIRONMENT] = str(config.resolve())
    settings = load_settings(config)
    if namespace is not None:
        settings = settings.model_copy(update={"wire": settings.wire.model_copy(update={"namespace": namespace})})
    folder = out or Path("out") / f"{_stem(source)}-{time.strftime('%Y%m%d-%H%M%S')}"
    sensor = [f"--start={start}", f"--rate={rate}", f"--seed={seed}", f"--sensor={kind}"]
    sensor += [f"--topic={one}" for one in topic or ()]
    sensor += [f"--option={one}" for one in option or ()]
    sensor += [f"--seconds={seconds}"] if seconds is not None else []
    sensor += [f"--camera={camera}"] if camera is not None else []
    sensor += [f"--end={end}"] if end is not None else []
    sensor += ["--realtime"] if realtime else []
    sensor += ["--live"] if live else []
    sensor += sensor_option or ()
    viewer = [*(["--web"] if web else []), *(["--headless"] if headless else [])]
    viewer += [f"--rrd={folder / 'session.rrd'}"] if rrd else []
    plan = RunPlan(
        source=source,
        out=folder,
        sensor_arguments=sensor,
        odometry_arguments=["--chain"] if chain else [],
        record=record,
        viewer_arguments=viewer if rrd or not headless else None,
        stay=stay,
        log_json=logs.as_json(),
    )
    summarise(run_all(plan, settings, stop), folder)


def _stem(source: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in Path(source).stem).strip("-") or "run"


def summarise(report: dict[str, Any], folder: Path) -> None:
    """Print what a person wants to know of a report."""
    processing = report["processing_ms"]
    typer.echo(
        f"{report['tracked']} of {report['frames']} frames tracked ({report['completeness']:.1%}), "
        f"{len(report['segments'])} segment(s), {report['loop_closures']} loop closure(s)"
    )
    if len(report["segments"]) > 1:
        poses = [part["frames"] for part in report["segments"]]
        typer.echo(
            f"trajectory.txt is the largest of {len(poses)} parts never joined: {poses[0]} of {sum(poses)} poses"
        )
    typer.echo(
        f"{report['fps']:.0f} frames/s, {processing['p50']:.1f} ms a frame (p99 {processing['p99']:.1f}), "
        f"{report['cpu_ms_per_frame']:.1f} ms CPU"
    )
    bad = [f"{report[name]} {name.split('_')[0]}" for name in ("lost_frames", "unmatched_frames") if report[name]]
    if bad:
        typer.echo(f"frames not used: {', '.join(bad)}")
    if report.get("ate_m") is not None:
        typer.echo(
            f"against truth ({report['matched']}/{report['total']} poses): ATE {_figure(report['ate_m'], 4)} m, "
            f"drift {_figure(report['rpe_1s_m'], 4)} m and {_figure(report['rpe_1s_deg'], 2)} deg over 1 s"
        )
    typer.echo(f"files: {folder}")


def _figure(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
