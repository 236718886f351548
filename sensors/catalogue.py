"""Finds the adapter of a SOURCE on the command line, and its options; an adapter is imported only when it is chosen."""

import math
from dataclasses import fields, replace
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from shlex import quote

from odom.errors import ConfigError
from sensors.folder_layouts import is_image_folder
from sensors.source import Source, SourceOptions
from sensors.source_options import read_options
from sensors.unread_layouts import unread_layout

_PLAYED = {"start", "end", "realtime", "rate", "loop"}
_SENT = {"color", "depth"}
_TAKES = {
    "arena": {"sensor", "seed", "seconds", "live", "extra"} | _PLAYED | _SENT,
    "a live camera": {"camera", "seconds", "extra"} | _SENT,
    "an .oni file": {"camera", "extra"} | _PLAYED | _SENT,
    "a camera of ROS 2": {"camera", "topics_from", "seconds", "extra", "depth"},
    "a motion capture server": {"seconds", "extra"},
    "a Motive export": {"extra", "realtime", "rate", "loop"},
    "a folder of images": {"camera"} | _PLAYED,
    "a recording": {"camera", "topics_from"} | _PLAYED,
}
"""Which fields of SourceOptions each kind of source has a use for."""
_TRUTH_ALONE = ("a motion capture server", "a Motive export")
_LIVE_CAMERAS = ("a live camera", "a camera of ROS 2")
_LONGEST_S = 1e8
"""Seconds of a source, three years: more is no length, but a date."""
_MOST_NAMES = 1000
"""Names in a folder among which the nearest to one that is not there is looked for: more would take seconds."""
_ARCHIVES = (".zip", ".tgz", ".tar", ".gz", ".bz2", ".xz", ".7z", ".rar")
_OPTIONS = {"topics_from": "--topic", "extra": "--option"}
"""What a field is called on the command line, where that is not its name."""


def open_source(spec: str, options: SourceOptions) -> Source:
    """Open the SOURCE `spec`.

    It is `arena`, `kinect[:URI]`, `kinect:FILE.oni`, `ros2:/camera`, an .mcap recording, a ROS bag or a TUM RGB-D
    folder; for truth alone `optitrack:SERVER` or a CSV file exported from Motive.

    Raises ConfigError when `spec` is none of these, or is told what it has no use for; SourceError when it cannot be
    opened.
    """
    kind = _kind(spec)
    _check_options(spec, kind, options)
    if options.loop:
        from sensors.loop import LoopedSource

        source = open_source(spec, replace(options, loop=False))
        if not source.lossless:
            source.close()
            raise ConfigError(f"{spec} is live and cannot begin again: --loop is for recordings")
        return LoopedSource(source)
    if kind == "arena":
        from sensors.arena import open_arena

        return open_arena(options)
    if kind in ("a live camera", "an .oni file"):
        from sensors.openni2 import open_kinect

        return open_kinect(spec, options)
    if kind == "a camera of ROS 2":
        from sensors.ros2 import open_ros2

        return open_ros2(spec, options)
    if kind in _TRUTH_ALONE:
        from sensors.optitrack import open_optitrack

        return open_optitrack(spec, options)
    if kind == "a folder of images":
        from sensors.tum import open_tum

        return open_tum(Path(spec), options)
    from sensors.replay import open_recording

    return open_recording(Path(spec), options)


def check_source(spec: str, options: SourceOptions) -> None:
    """Raise what `open_source` would for a wrong call; no device is touched, nothing is drawn, nothing stays open."""
    kind = _kind(spec)
    _check_options(spec, kind, options)
    if options.camera is not None and kind != "a folder of images":
        from sensors.calibration_file import load_calibration

        load_calibration(options.camera)
    if kind == "arena":
        from sensors.arena.source import arena_options

        arena_options(options)
    elif kind == "a live camera":
        from sensors.openni2.settings import KinectSettings

        read_options("kinect", KinectSettings, dict(options.extra))
    elif kind == "a camera of ROS 2":
        from sensors.ros2 import ros2_settings

        ros2_settings(spec, options)
    elif kind == "a motion capture server":
        from sensors.optitrack import optitrack_settings

        optitrack_settings(spec, options)
    else:
        open_source(spec, options).close()


def check_images(spec: str, again: bool = False) -> None:
    """Raise ConfigError for a SOURCE without images and, where they are needed `again`, for one that is live."""
    kind = _kind(spec)
    if kind in _TRUTH_ALONE:
        raise ConfigError(
            f"{spec} is {kind} and has no images: give a camera, and beside it "
            f"`odom sensor {quote(spec)} --namespace mocap`"
        )
    if again and kind in _LIVE_CAMERAS:
        raise ConfigError(f"{spec} is live: record it first, as with `odom run {quote(spec)} --record walk.mcap`")


def takes_calibration(spec: str) -> bool:
    """Return whether a SOURCE can be told its camera's calibration; raises ConfigError as above."""
    return "camera" in _TAKES[_kind(spec)]


def _kind(spec: str) -> str:
    if spec == "arena":
        return "arena"
    if spec == "kinect" or spec.startswith("kinect:"):
        return "an .oni file" if spec.endswith(".oni") else "a live camera"
    if spec == "ros2" or spec.startswith("ros2:"):
        return "a camera of ROS 2"
    if spec.startswith("optitrack:"):
        return "a motion capture server"
    path = Path(spec)
    if is_image_folder(path):
        return "a folder of images"
    if spec.endswith(".csv") and path.is_file():
        return "a Motive export"
    from odom.wire.recording import is_recording

    if path.exists() and is_recording(path):
        return "a recording"
    if path.exists():
        raise no_source(path)
    what = "a SOURCE is arena, kinect, ros2:/camera, a recording, a ROS bag or a folder of images"
    raise ConfigError(f"{spec}: no such file or folder{_nearest(path)}; {what}")


def no_source(path: Path) -> ConfigError:
    """Return what is said of a file or folder that is there and holds nothing that can be read."""
    return ConfigError(
        unread_layout(path)
        or f"{path} is neither an .mcap recording, a ROS bag (.bag, .db3, or a folder of .db3 files or with "
        "metadata.yaml) nor a folder of images: TUM's (with rgb.txt and depth.txt), 7-Scenes', ScanNet's, "
        "Replica's or ICL-NUIM's, or colour and depth in folders of their own (color/ or rgb/, and depth/) or told "
        "apart by the names of the images (rgb_0001.png, depth_0001.png)"
        f"{_inside_or_above(path)}"
    )


def _inside_or_above(path: Path) -> str:
    """Return a hint at a source in the folders inside a path or above it, or that an archive must be unpacked."""
    from odom.wire.recording import is_recording

    if path.is_file() and path.suffix.lower() in _ARCHIVES:
        return f"; unpack {path.name} first, and give the folder"
    inside = [child for level in ("*", "*/*") for child in sorted(islice(path.glob(level), _MOST_NAMES))]
    near = (place for place in (*inside, *list(path.absolute().parents)[:2]) if not place.name.startswith("."))
    found = next((place for place in near if is_image_folder(place) or is_recording(place)), None)
    return "" if found is None else f"; did you mean {found}?"


def _nearest(path: Path) -> str:
    """Return a hint at the name beside a path that is nearest to it, empty when none is near."""
    here = [each.name for each in islice(path.parent.iterdir(), _MOST_NAMES)] if path.parent.is_dir() else []
    found = get_close_matches(path.name, [*here, *(("arena", "kinect") if path.parent == Path() else ())], n=1)
    return f" (did you mean {path.with_name(found[0])}?)" if found else ""


def _check_options(spec: str, kind: str, options: SourceOptions) -> None:
    """Raise ConfigError for what the source has no use for, and for times that contradict each other."""
    given = {field.name: getattr(options, field.name) for field in fields(options) if field.name != "topics"}
    unset = SourceOptions()
    useless = [name for name in given if name not in _TAKES[kind] and given[name] != getattr(unset, name)]
    if useless:
        names = ", ".join(map(_option, useless))
        known = ", ".join(_option(name) for name in given if name in _TAKES[kind])
        raise ConfigError(f"{spec} is {kind} and has no use for {names}: it takes {known}")
    for name, value in given.items():
        if isinstance(value, float) and not math.isfinite(value):
            raise ConfigError(f"{_option(name)} {value}: give a number of seconds")
        if name in ("start", "end", "seconds") and value is not None and value > _LONGEST_S:
            raise ConfigError(
                f"{_option(name)} {value:g}: give at most {_LONGEST_S:g} seconds, counted from the beginning"
            )
    if options.end is not None and options.end <= options.start:
        raise ConfigError(
            f"--end {options.end:g} is not behind --start {options.start:g}, and both count from the beginning"
        )
    if options.rate != unset.rate and not options.realtime:
        raise ConfigError(f"--rate {options.rate:g} is the speed of --realtime: give both or none")


def _option(name: str) -> str:
    return _OPTIONS.get(name, f"--{name}")
