"""`odom calibrate SOURCE...`: the camera's calibration from the walk itself."""

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from odom.cli import signals
from odom.cli.options import Calibration as CameraFile
from odom.cli.options import (
    Config,
    End,
    MaskFile,
    OwnTopics,
    Seconds,
    Seed,
    SimulatedSensor,
    SourceOption,
    Start,
    pairs,
)
from odom.cli.outputs import check_place

if TYPE_CHECKING:
    from odom.service.calibration_run import Outcome
    from sensors.depth_registration import DepthRegistration


def calibrate(
    sources: Annotated[
        list[str],
        typer.Argument(
            help="Walks with one camera: recordings, ROS bags, folders of images, arena.", metavar="SOURCE..."
        ),
    ],
    out: Annotated[Path, typer.Option(help="Calibration to write, for --camera; report and picture beside it.")],
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the files if they exist.")] = False,
    camera: CameraFile = None,
    mask: MaskFile = None,
    start: Start = 0.0,
    end: End = None,
    seconds: Seconds = None,
    topic: OwnTopics = None,
    option: SourceOption = None,
    kind: SimulatedSensor = "kinect1",
    seed: Seed = 1,
    config: Config = None,
) -> None:
    """Find a camera's calibration in ordinary walks with it: lens, depth against colour, and how depth errs.

    Walk and look around as usual: turn to all sides, hold the camera upright and on its side, see things from near and
    from far. What the walk does not show stays as it was, and is told. With motion capture in the recording, the unit
    of depth is tied to it. Exit status 1 when nothing better was found.

    Example: odom calibrate recordings/arena.mcap --out out/camera.yaml
    """
    stop = signals.stop_event()
    import cv2

    from odom.backend.settings import OdometrySettings
    from odom.errors import ConfigError
    from odom.service.calibration_files import how_to_use, remarks
    from odom.service.calibration_run import calibrate_recordings
    from odom.service.progress import counting
    from odom.service.settings_sources import part_settings
    from odom.wire import Topics
    from sensors.catalogue import check_images, check_source, open_source
    from sensors.folder_camera import depth_images_of
    from sensors.needed_images import NeededImages
    from sensors.source import SourceOptions

    if out.suffix not in (".yaml", ".yml"):
        raise ConfigError(f"--out {out}: give the name of a .yaml file")
    files = [out, out.with_suffix(".txt"), out.with_suffix(".png")]
    if not overwrite and (there := [str(file) for file in files if file.exists()]):
        raise ConfigError(f"{', '.join(there)}: there already; give --overwrite or another --out")
    check_place("--out", out)
    cv2.setNumThreads(1)
    chosen = SourceOptions(
        camera=camera, start=start, end=end, topics_from=pairs("--topic", topic), sensor=kind, seed=seed,
        seconds=seconds, extra=pairs("--option", option),
    )  # fmt: skip
    for source in sources:
        check_images(source, again=True)
        check_source(source, chosen)
    settings = part_settings("odometry", OdometrySettings, config, {})
    with ExitStack() as stack:

        def begin(what: str) -> Callable[[int], None]:
            stack.close()
            return stack.enter_context(counting(what, None))

        opened = [
            lambda source=source: NeededImages(source, open_source(source, chosen), Topics()) for source in sources
        ]
        outcome = calibrate_recordings(opened, Topics(), settings, begin, stop.is_set, mask)
    text = remarks(outcome, sources)
    for line in text:
        typer.echo(line)
    _settle(outcome, files, text, *depth_images_of(sources[0], camera))
    typer.echo(how_to_use(sources[0], out))


def _settle(
    outcome: "Outcome", files: list[Path], text: list[str], depth_scale: float, registered: "DepthRegistration | None"
) -> None:
    """Write what is worth it; exit with 1 where nothing is."""
    from odom.service.calibration_files import write_calibration

    judgement = outcome.judgement
    if judgement is not None and not judgement.is_better:
        typer.echo("nothing written: frames that were held out are explained no better; the calibration given is kept")
        raise typer.Exit(1)
    write_calibration(files, outcome, text, depth_scale, registered)
