"""How a SOURCE on the command line is found; an adapter is imported when it is chosen."""

from dataclasses import replace
from pathlib import Path

from odom.errors import ConfigError, SourceError
from sensors.source import Source, SourceOptions


def open_source(spec: str, options: SourceOptions) -> Source:
    """Open the SOURCE `spec`.

    It is `arena`, `kinect[:URI]`, `kinect:FILE.oni`, an .mcap recording, a ROS bag or a TUM RGB-D folder;
    for truth alone `optitrack:SERVER` or a CSV file exported from Motive.

    Raises ConfigError when `spec` is none of these or is live and to be looped, SourceError when it cannot be opened.
    """
    if options.loop:
        from sensors.loop import LoopedSource

        source = open_source(spec, replace(options, loop=False))
        if not source.lossless:
            source.close()
            raise ConfigError(f"{spec} is live and cannot begin again: --loop is for recordings")
        return LoopedSource(source)
    if spec == "arena":
        from sensors.arena import open_arena

        return open_arena(options)
    if spec == "kinect" or spec.startswith("kinect:"):
        from sensors.openni2 import open_kinect

        return open_kinect(spec, options)
    if spec.startswith("optitrack:") or spec.endswith(".csv"):
        from sensors.optitrack import open_optitrack

        return open_optitrack(spec, options)
    path = Path(spec)
    if (path / "rgb.txt").is_file():
        from sensors.tum import open_tum

        return open_tum(path, options)
    from odom.wire.recording import is_recording

    if path.exists() and is_recording(path):
        from sensors.replay import open_recording

        return open_recording(path, options)
    if path.exists():
        raise ConfigError(
            f"{spec} is neither an .mcap recording, a ROS bag (.bag, .db3, or a folder of .db3 files or with "
            "metadata.yaml) nor a TUM RGB-D folder (with rgb.txt and depth.txt)"
        )
    raise SourceError(f"{spec}: no such file or folder; a SOURCE is arena, kinect, an .mcap file or a TUM RGB-D folder")
