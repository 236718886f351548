"""`odom export RUN_OR_MCAP... --to FORMAT`: results in the formats of other tools."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from odom.cli import options, signals
from odom.cli.outputs import check_place

if TYPE_CHECKING:
    import threading

    from odom.export.writing import ExportOptions
    from odom.rgbd_recording import RgbdRecording
    from odom.service.settings import Settings

Format = Literal["colmap", "nerfstudio", "ply", "mesh", "g2o", "kitti", "euroc", "tum"]
_TRAJECTORIES = ("kitti", "euroc", "tum")


def export(
    sources: Annotated[list[Path], typer.Argument(help="Recordings; for tum, kitti and euroc folders of runs, too.")],
    to: Annotated[Format, typer.Option(help="What to write.")],
    out: Annotated[Path, options.out_folder("Folder to write, new or empty; of several sources one below it each.")],
    neighbours: Annotated[
        int, typer.Option(min=0, help="Frames on each side of a key frame of which the sharpest is taken.")
    ] = 2,
    unroll: Annotated[
        bool, typer.Option(help="Undo the rolling shutter; else images stay, posed at their middle rows.")
    ] = True,
    voxel: Annotated[float, typer.Option(min=0.001, help="Side of a cube of ply and mesh, m.")] = 0.01,
    farthest: Annotated[float, typer.Option(min=0.1, help="Depth beyond is left out of ply and mesh, m.")] = 4.0,
    memory: Annotated[float, typer.Option(min=1, help="The most that a mesh may take, MB.")] = 1500.0,
    camera: options.Calibration = None,
    mask: options.MaskFile = None,
    start: options.Start = 0.0,
    end: options.End = None,
    config: options.Config = None,
) -> None:
    """Run the odometry over recordings and write trajectory, key frames or map for other tools.

    Everything is in the frame `map`: the first camera's, z forward, y down. Of parts that were never joined the largest
    is written.

    Example: odom export recordings/arena.mcap --to colmap --out out/colmap

    Example: odom export recordings/arena.mcap --to mesh --voxel 0.02 --out out/mesh
    """
    stop = signals.stop_event()
    from odom.errors import ConfigError, OdomError, SourceError
    from odom.evaluation.files import read_run
    from odom.export.mesh import open3d
    from odom.export.writing import ExportOptions, write_trajectory
    from odom.rgbd_recording import read_recording
    from odom.service.settings import load_settings

    settings = options.with_mask(load_settings(config), mask)
    for source in sources:
        if not source.exists():
            raise SourceError(f"{source}: no such file or folder")
        if (source / "trajectory.txt").is_file() and to not in _TRAJECTORIES:
            raise ConfigError(f"{source} holds poses alone: give the recording that they are of for --to {to}")
    if to == "mesh":
        open3d()
    names = [place.name if place.is_dir() else place.stem for place in map(Path.resolve, sources)]
    if len(set(names)) < len(names):
        raise ConfigError(f"two sources have one name: {', '.join(names)}; export them one by one")
    folders = [out / name if len(names) > 1 else out for name in names]
    for folder in folders:
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise ConfigError(f"{folder} is there already: give a new or empty folder")
        check_place("--out", folder / to)
    wanted = ExportOptions(neighbours, unroll, voxel, farthest, memory)
    for number, (source, folder) in enumerate(zip(sources, folders, strict=True), 1):
        part = ""
        if (source / "trajectory.txt").is_file():
            folder.mkdir(parents=True, exist_ok=True)
            run = read_run(source)
            write_trajectory(folder, to, run.longest_segment())
            if run.segment_count > 1:
                part = f" (the largest of {run.segment_count} parts)"
        else:
            recording = read_recording(source, camera, start=start, end=end)
            part = _export_recording(recording, to, folder, wanted, settings, stop)
        typer.echo(f"{source}: {to} in {folder}{part}")
        if stop.is_set() and number < len(sources):
            raise OdomError(f"interrupted: {len(sources) - number} of {len(sources)} sources were not exported")


def _export_recording(
    recording: "RgbdRecording",
    to: Format,
    folder: Path,
    wanted: "ExportOptions",
    settings: "Settings",
    stop: "threading.Event",
) -> str:
    """Run the odometry over a recording and write what is wanted; return of which part, if it was interrupted."""
    import cv2

    from odom.export.views import survey
    from odom.export.writing import Exporter, write_trajectory
    from odom.service.mask_file import masked_by
    from odom.service.progress import counting

    cv2.setNumThreads(1)
    segmenter = masked_by(settings.service.mask, recording.camera)
    is_interrupted = False

    def is_stopped() -> bool:
        nonlocal is_interrupted
        is_interrupted = is_interrupted or stop.is_set()
        return is_interrupted

    with counting("odometry", None) as progress:
        surveyed = survey(recording, settings.odometry, progress, is_stopped, segmenter)
    is_read = not is_interrupted
    scene = surveyed.scene
    if surveyed.off_px is not None:
        typer.echo(f"the calibration given is off by {surveyed.off_px:.1f} px: another that was found is taken for all")
    of_parts = f", the largest of {scene.parts} parts" if scene.parts > 1 else ""
    typer.echo(
        f"{len(scene.trajectory)} of {len(surveyed.stamps)} frames{of_parts}: {len(scene.keyframes)} key frames, "
        f"{scene.landmarks_seen} landmarks"
    )
    folder.mkdir(parents=True, exist_ok=True)
    if to in _TRAJECTORIES:
        write_trajectory(folder, to, scene.trajectory)
    else:
        with counting(to, len(scene.keyframes), unit="key frames") as progress:
            until = is_stopped if is_read else lambda: False
            exporter = Exporter(folder, surveyed, recording, wanted, progress, typer.echo, until)
            writers = {
                "colmap": exporter.write_colmap,
                "nerfstudio": exporter.write_nerfstudio,
                "ply": exporter.write_ply,
                "mesh": exporter.write_mesh,
                "g2o": exporter.write_g2o,
            }
            writers[to]()
    return f" (of what was {'written' if is_read else 'read'} until the interruption)" if is_interrupted else ""
