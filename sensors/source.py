"""The protocol that every sensor, folder and recording offers to the sensor process."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

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
        """Yield the messages; a live source blocks until the next one is due, a recorded one begins anew each time."""

    def close(self) -> None:
        """Give back the device or file; `messages` then ends, although another thread may wait in it.

        Safe to call twice and from a signal's clean-up.
        """


@dataclass(frozen=True)
class SourceOptions:
    """What the command line says about a source; each adapter uses what applies to it.

    `start` and `end` are seconds from the beginning of a recording, `rate` is the speed of `realtime` playback.
    `camera` replaces the calibration. `color` is how a live sensor sends colour: `jpeg` or `raw`; `depth`: `raw`,
    `rvl` or `png`. `topics_from` names the recording's own topics where types do not settle them
    (keys `color`, `depth`, `camera_info`, `truth`). `sensor`, `seed`, `seconds` and `live` steer the simulated arena.
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


def refused_images(source: Source) -> Mapping[tuple[str, str], int]:
    """Return how many images a source left out, by stream (`colour`, `depth`) and reason; most leave out none."""
    refused: Mapping[tuple[str, str], int] = getattr(source, "refused", {})
    return {key: count for key, count in refused.items() if key[0] in ("colour", "depth")}


def damage_of(source: Source) -> list[str]:
    """Return in words what of a recorded source was found cut, damaged or missing by the end of its messages."""
    return list(getattr(source, "damage", ()))


def serial_of(source: Source) -> str:
    """Return the serial number of a source that is a device, empty for any other."""
    return str(getattr(source, "serial", ""))
