"""What is handed to Rerun: archetypes for one entity at a time, and the paths of all entities."""

from dataclasses import dataclass

import numpy as np
import rerun as rr

from odom.frame import Stamp
from odom.geometry.arrays import Array

WORLD = "world"
ONLINE = "world/online"
CORRECTED = "world/corrected"
UNJOINED = "world/unjoined"
TRUTH = "world/truth"
CHAIN = "world/chain"
CHAIN_CLOSED = "world/chain_closed"
KEYFRAMES = "world/keyframes"
CLOUDS = "world/clouds"
LANDMARKS = "world/landmarks"
COVARIANCE = "world/covariance"
LOOPS_ACCEPTED = "world/loops/accepted"
LOOPS_REFUSED = "world/loops/refused"
CAMERA = "world/camera"
COLOR = "world/camera/color"
FEATURES = "world/camera/color/features"
MOVING = "world/camera/color/moving"
DEPTH = "world/camera/depth"
POSITION_ERROR = "plots/position_error"
ROTATION_ERROR = "plots/rotation_error"
INLIERS = "plots/inliers"
TIMES = "plots/times"
LOG = "log"
SUMMARY = "summary"

TIMELINE = "capture"
"""Timeline of the capture stamps; a run whose stamps go back gets one of its own, "capture 2" and so on."""


@dataclass(frozen=True, eq=False)
class EntityUpdate:
    """Archetypes `parts` of the entity `path` from `stamp` on; without a stamp they hold at all times."""

    path: str
    stamp: Stamp | None
    parts: tuple[rr.AsComponents, ...]


def update(path: str, stamp: Stamp | None, *parts: rr.AsComponents) -> EntityUpdate:
    """Return a `EntityUpdate`."""
    return EntityUpdate(path, stamp, parts)


def transform(T_parent_child: Array) -> rr.Transform3D:
    """Return the archetype of a 4 x 4 rigid motion."""
    return rr.Transform3D(translation=T_parent_child[:3, 3], mat3x3=T_parent_child[:3, :3])


def log_to(recording: rr.RecordingStream, item: EntityUpdate, timeline: str = TIMELINE) -> None:
    """Log one item, by its stamp on a timeline."""
    if item.stamp is None:
        recording.log(item.path, *item.parts, static=True)
        return
    recording.reset_time()  # else it would be at the end of the timeline before, too
    recording.set_time(timeline, timestamp=np.datetime64(item.stamp, "ns"))
    recording.log(item.path, *item.parts)
