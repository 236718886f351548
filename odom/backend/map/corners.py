"""New corners of a key frame, of which landmarks are made."""

from dataclasses import dataclass

import numpy as np

from odom.frontend.features.measurement import Measurements
from odom.geometry.arrays import Array, Mask


@dataclass(frozen=True, eq=False)
class Corners:
    """New corners of a key frame, at `uv` (n x 2 px), with what was measured of them."""

    uv: Array
    measurements: Measurements

    @property
    def has_depth(self) -> Mask:
        """Of which of them depth was measured (n)."""
        return ~np.isnan(self.measurements.values[:, 2])

    def take(self, chosen: Mask) -> "Corners":
        """Return the chosen ones."""
        return Corners(self.uv[chosen], self.measurements.take(chosen))
