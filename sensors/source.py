"""What every sensor, folder and recording looks like to the sensor process, and how a SOURCE is found."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from odom.errors import ConfigError, SourceError
from odom.wire import Message, Topics


class Source(Protocol):
    """A stream of wire messages in the order of their capture stamps."""

    @property
    def lossless(self) -> bool:
        """True: recorded, waits for acknowledgement. False: live, newest wins."""

    @property
    def length(self) -> int | None:
        """Number of colour frames, if known."""

    def messages(self) -> Iterator[Message]:
        """Yield the messages; a live source blocks until the next one is due."""

    def close(self) -> None:
        """Give back the device or file; safe to call twice and from a signal's clean-up."""


@dataclass(frozen=True)
class SourceOptions:
    """What the command line says about a source; each adapter uses what applies to it.

    `start` and `end` are seconds from the beginning of a recording, `rate` is the speed of `realtime` playback.
    `camera` replaces the calibration. `color` is how a live sensor sends colour: `jpeg` or `raw`; `depth`: `raw`,
    `rvl` or `png`. `topics_from` names the recording's own topics where types do not settle them
    (keys `color`, `depth`, `camera_info`). `sensor`, `seed`, `seconds` and `live` steer the simulated arena.
    """

    topics: Topics = field(default_factory=Topics)
    camera: Path | None = None
    start: float = 0.0
    end: float | None = None
    realtime: bool = False
    rate: float = 1.0
    loop: bool = False
    color: str = "jpeg"
    depth: str = "raw"
    topics_from: tuple[tuple[str, str], ...] = ()
    sensor: str = "kinect1"
    seed: int = 1
    seconds: float | None = None
    live: bool = False
    extra: tuple[tuple[str, str], ...] = ()


def open_source(spec: str, options: SourceOptions) -> Source:
    """Open the SOURCE `spec`.

    It is `arena`, `kinect[:URI]`, `kinect:FILE.oni`, an .mcap recording, a ROS 2 bag folder or a TUM RGB-D folder;
    for truth alone `optitrack:SERVER` or a CSV file exported from Motive.

    Raises ConfigError when `spec` is none of these, SourceError when it cannot be opened.
    """
    if options.loop:
        from sensors.loop import LoopedSource

        once = replace(options, loop=False)
        return LoopedSource(lambda: open_source(spec, once))
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
    if (path.suffix == ".mcap" and path.is_file()) or (path / "metadata.yaml").is_file():
        from sensors.replay import open_recording

        return open_recording(path, options)
    if path.exists():
        raise ConfigError(
            f"{spec} is neither an .mcap recording, a ROS 2 bag folder (with metadata.yaml) nor a TUM RGB-D folder "
            "(with rgb.txt and depth.txt)"
        )
    raise SourceError(f"{spec}: no such file or folder; a SOURCE is arena, kinect, an .mcap file or a TUM RGB-D folder")
