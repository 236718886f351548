"""Arguments and options that several commands take, and what they mean as settings."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from odom.cli.outputs import check_place
from odom.errors import ConfigError, MapError

if TYPE_CHECKING:
    from odom.service.settings import Settings
    from odom.wire.settings import WireSettings

Config = Annotated[Path | None, typer.Option(help="YAML file of settings.")]
Namespace = Annotated[str | None, typer.Option(help="Name of the device, first part of its keys.")]
Listen = Annotated[list[str] | None, typer.Option(help="Zenoh endpoint to listen on.")]
Mode = Annotated[Literal["peer", "client", "router"] | None, typer.Option(help="Zenoh role.")]
Connect = Annotated[list[str] | None, typer.Option(help="Zenoh endpoint to connect to.")]
Compression = Annotated[
    Literal["zstd", "lz4", "none"], typer.Option(help="How the messages in the file are compressed.")
]
MaskFile = Annotated[
    Path | None, typer.Option("--mask", help="Image, white where the camera sees what carries it (see odom mask).")
]
Calibration = Annotated[Path | None, typer.Option(help="Calibration: ROS's or OpenCV's YAML, or ORB-SLAM's settings.")]
SourceName = Annotated[
    str,
    typer.Argument(
        help="arena, kinect[:URI], kinect:FILE.oni, ros2:/camera, a recording, ROS bag or folder of images."
    ),
]
Seed = Annotated[int, typer.Option(min=0, help="Seed of the arena.")]
Start = Annotated[float, typer.Option(min=0, help="Seconds of a recording to skip.")]
End = Annotated[float | None, typer.Option(min=0, help="Seconds from a recording's beginning to stop at.")]
Seconds = Annotated[
    float | None,
    typer.Option(min=0.001, help="End after so many seconds (arena, live cameras, ROS 2, motion capture)."),
]
OwnTopics = Annotated[
    list[str] | None, typer.Option(help="A recording's own topic: color=, depth=, camera_info= or truth=/name.")
]
SourceOption = Annotated[
    list[str] | None,
    typer.Option(
        help="A setting of the source itself: name=value (kinect, arena, ros2, optitrack; a wrong name lists all)."
    ),
]
SimulatedSensor = Annotated[Literal["kinect1", "kinect2"], typer.Option("--sensor", help="What the arena simulates.")]
Ros2 = Annotated[
    int | None,
    typer.Option(
        "--ros2", metavar="[DOMAIN]", min=0, max=232, help="Be seen by ROS 2 (rmw_zenoh), by default in $ROS_DOMAIN_ID."
    ),
]
MapFileOption = Annotated[
    Path | None, typer.Option("--map", help="Map that outlives the run: made in this file, or gone on with.")
]
Localize = Annotated[
    bool, typer.Option("--localize", help="Only find the camera in the map of --map; nothing is written to it.")
]
Rate = Annotated[float, typer.Option(min=0.001, help="Speed of --realtime.")]


def out_folder(meaning: str) -> Any:
    """Return the option `--out` for a folder, which refuses an empty text: `Path("")` is the present folder."""
    return typer.Option("--out", help=meaning, parser=_named, metavar="PATH")


def _named(text: str) -> Path:
    if not text:
        raise typer.BadParameter("is empty: give a folder, '.' for this one")
    return Path(text)


def wire_settings(
    config: Path | None,
    connect: Sequence[str] | None,
    listen: Sequence[str] | None,
    mode: str | None,
    namespace: str | None,
    ros2: int | None = None,
) -> "WireSettings":
    """Return the session's settings; raises ConfigError as `part_settings`, and for a namespace that cannot be."""
    from odom.service.settings_sources import part_settings
    from odom.wire.settings import WireSettings
    from odom.wire.topics import Topics

    endpoints = {"connect": connect or None, "listen": listen or None}
    given = {**endpoints, "mode": mode, "namespace": namespace, "ros2_domain": ros2}
    settings = part_settings("wire", WireSettings, config, given)
    Topics(settings.namespace)
    return settings


def check_map(path: Path | None, localize: bool) -> None:
    """Refuse, before anything is touched, a map that cannot be read, or extended unless `localize`.

    Raises ConfigError.
    """
    if path is None:
        if localize:
            raise ConfigError("--localize needs a map: give --map FILE")
        return
    from odom.map_file.database import is_there, lock
    from odom.map_file.map_file import MapFile

    keyframes = 0
    try:
        if not localize:
            check_place("--map", path.resolve())
            if path.is_file():
                os.close(lock(path))
        if localize or is_there(path):
            keyframes = MapFile(path, is_written=False).check_readable()
    except MapError as error:
        raise ConfigError(str(error)) from error
    if localize and not keyframes:
        raise ConfigError(
            f"{path} holds no key frame, so no camera can be found in it: run without --localize to extend it"
        )


def with_mask(settings: "Settings", path: Path | None) -> "Settings":
    """Return the settings with the mask that an option gives, if it does; raises ConfigError where it is none."""
    from odom.service.mask_file import read_mask

    if path is not None:
        settings = settings.model_copy(update={"service": settings.service.model_copy(update={"mask": path})})
    if settings.service.mask is not None:
        read_mask(settings.service.mask)
    return settings


def odometry_arguments(map_: Path | None, localize: bool, mask: Path | None) -> list[str]:
    """Return the same options for `odom serve`."""
    files = [f"--{name}={path}" for name, path in (("map", map_), ("mask", mask)) if path is not None]
    return [*files, *(["--localize"] if localize else [])]


def pairs(option: str, values: Iterable[str] | None) -> tuple[tuple[str, str], ...]:
    """Split `name=value` arguments; raises ConfigError for one without `=`."""
    split = tuple((name, value) for name, _, value in (text.partition("=") for text in values or ()))
    if any(not name or not value for name, value in split):
        raise ConfigError(f"{option} {' '.join(values or ())}: give name=value")
    return split
