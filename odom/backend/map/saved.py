"""A map as frozen values that a process can save and bring back: key frames, registrations, and what each measured.

Landmarks are held in the camera frame of the key frame that saw them first, so that a key frame that moves needs no
new details. `Landmarks.identity` names a landmark for ever: that is how details refer to those of other key frames.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from odom.backend.map.pose_graph import Edge
from odom.frame import Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.sensor_memory import SensorMemory
from odom.frontend.features.measurement import Measurements
from odom.frontend.features.place_descriptor import Place
from odom.frontend.matching.place_block import PlaceBlock
from odom.geometry.arrays import Array, Index, Mask


@dataclass(frozen=True, eq=False)
class SavedKeyframe:
    """Where a key frame is (see `Keyframe`), the `session` that made it, and the earlier ones it is linked with."""

    number: int
    session: int
    stamp: Stamp
    segment: int
    first: int
    T_camera_map: Array
    T_middle_stamp: Array
    covariance_since_start: Array
    links: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class SavedLandmarks:
    """The m landmarks that a key frame saw first (see `Landmarks`), in its camera frame."""

    identity: Index
    position: Array
    covariance: Array
    uv: Array
    plane: Array
    patch_full: NDArray[np.uint8]
    patch_half: NDArray[np.uint8]
    seen: Index
    tried: Index
    assumed: Mask


@dataclass(frozen=True, eq=False)
class SavedDetails:
    """What a key frame measured, of which landmarks (`identities`, n), its own landmarks, and the place it shows."""

    timing: ShutterTiming
    identities: Index
    uv: Array
    measurements: Measurements
    landmarks: SavedLandmarks
    place: Place | None


class Details(Protocol):
    """Where details of key frames are kept while they are not in memory; asked from the background as well."""

    def expect(self, numbers: Iterable[int]) -> None:
        """Begin to read key frames that may soon be fetched; nothing else depends on it."""

    def fetch(self, number: int) -> SavedDetails | None:
        """Return the details of a key frame, None where they cannot be had."""

    def fetch_place(self, number: int) -> Place | None:
        """Return the place alone, None where the key frame has none or it cannot be had."""


@dataclass(frozen=True, eq=False)
class SavedMap:
    """An opened map: its key frames, by number from 0 on, and registrations; `details` are fetched when needed.

    `blocks` are the index of the places, and `next_identity` is the first that no landmark has had. With `is_fixed`
    nothing that was saved moves any more, and the camera has no pose until a place is recognised; otherwise the map is
    extended as `session`. `sensor` is what the newest session has learnt of the camera.
    """

    keyframes: tuple[SavedKeyframe, ...]
    edges: tuple[Edge, ...]
    details: Details
    blocks: tuple[PlaceBlock, ...] = ()
    next_identity: int = 1
    session: int = 0
    is_fixed: bool = False
    sensor: SensorMemory | None = None


@dataclass(frozen=True, eq=False)
class MapChanges:
    """What is new or has changed since changes were last taken: values that replace earlier ones.

    `poses` are T_camera_map of further key frames, by number, of which nothing else has changed.
    """

    keyframes: tuple[SavedKeyframe, ...] = ()
    edges: tuple[Edge, ...] = ()
    details: Mapping[int, SavedDetails] = field(default_factory=dict)
    next_identity: int = 1
    sensor: SensorMemory | None = None
    poses: Mapping[int, Array] = field(default_factory=dict)

    @property
    def is_empty(self) -> bool:
        """Whether nothing has changed."""
        return not (self.keyframes or self.edges or self.details or self.poses)
