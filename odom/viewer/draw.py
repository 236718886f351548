"""What is handed to Rerun: archetypes for an entity at a time."""

from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from odom.frame import Stamp

Array = NDArray[np.float64]

TIMELINE = "capture"
"""Timeline of the capture stamps."""


@dataclass(frozen=True, eq=False)
class Draw:
    """Archetypes `parts` of the entity `path` from `stamp` on; without a stamp they hold at all times."""

    path: str
    stamp: Stamp | None
    parts: tuple[rr.AsComponents, ...]


def draw(path: str, stamp: Stamp | None, *parts: rr.AsComponents) -> Draw:
    """Return a `Draw`."""
    return Draw(path, stamp, parts)


def transform(T_parent_child: Array) -> rr.Transform3D:
    """Return the archetype of a 4 x 4 rigid motion."""
    return rr.Transform3D(translation=T_parent_child[:3, 3], mat3x3=T_parent_child[:3, :3])


def log_to(recording: rr.RecordingStream, item: Draw) -> None:
    """Log one item."""
    if item.stamp is None:
        recording.log(item.path, *item.parts, static=True)
        return
    recording.set_time(TIMELINE, timestamp=np.datetime64(item.stamp, "ns"))
    recording.log(item.path, *item.parts)
