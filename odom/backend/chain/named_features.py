"""The features that a frame of the chain measured, by names that the next frame finds again."""

from dataclasses import dataclass

import numpy as np

from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.frontend.features.measurement import Measurements
from odom.geometry.arrays import Array, Index
from odom.geometry.numbered import shared


@dataclass(frozen=True, eq=False)
class NamedFeatures:
    """n features of a frame: their `names` (n), where they were seen (`uv`, n x 2 px), and what was `measured`.

    Landmarks of the map have their identities for names, the chain's own corners negative numbers.
    """

    names: Index
    uv: Array
    measured: Measurements

    @classmethod
    def of(cls, tracked: TrackedFrame, identities: Index) -> "NamedFeatures":
        """Return the landmarks that the map's search found in a frame, by their `identities` (n).

        Landmarks that were culled since have the identity 0 and are left out.
        """
        alive = identities > 0
        if alive.all():
            return cls(identities, tracked.uv, tracked.measurements)
        return cls(identities[alive], tracked.uv[alive], tracked.measurements.take(alive))

    @classmethod
    def nothing(cls) -> "NamedFeatures":
        """Return the value for no feature."""
        return cls(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), Measurements.nothing())

    def __len__(self) -> int:
        return len(self.names)

    def joined(self, other: "NamedFeatures") -> "NamedFeatures":
        """Return these features followed by the `other` ones."""
        return NamedFeatures(
            np.concatenate([self.names, other.names]),
            np.concatenate([self.uv, other.uv]),
            self.measured.joined(other.measured),
        )

    def take(self, rows: Index) -> "NamedFeatures":
        """Return the chosen features."""
        return NamedFeatures(self.names.take(rows), self.uv.take(rows, 0), self.measured.take(rows))

    def in_common_with(self, other: "NamedFeatures") -> tuple["NamedFeatures", "NamedFeatures"]:
        """Return what this one and the `other` measured of the features of both, in the same order."""
        here, there = shared(self.names, other.names)
        return self.take(here), other.take(there)
