"""A depth image and the colour image it is registered to, as a cloud of coloured points with normals."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.errors import InputError
from odom.frontend.cloud_features.neighbourhood import Cells, scatters
from odom.geometry.arrays import Array, Image

_GREY = np.array([0.299, 0.587, 0.114])
"""Shares of red, green and blue in brightness (ITU-R BT.601)."""
_LEAST_FOR_A_NORMAL = 5
"""Fewer points within the radius settle no plane: such a point has no normal."""


@dataclass(frozen=True, eq=False)
class Cloud:
    """n points (n x 3, m, camera frame) and their colours (n x 3, red, green and blue from 0 to 255).

    Raises InputError where shapes disagree or a value is not finite: leave such points out.
    """

    points: Array
    colors: Array

    def __post_init__(self) -> None:
        for name in ("points", "colors"):
            values = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            if values.ndim != 2 or values.shape[1] != 3 or len(values) != len(self.points):
                raise InputError(f"{name} have shape {values.shape}: give n x 3 points and as many colours")
            if not np.isfinite(values).all():
                raise InputError(f"{name} hold values that are not finite: leave those points out")
            object.__setattr__(self, name, values)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def intensities(self) -> Array:
        """How bright each point is (n, 0 to 255)."""
        return np.asarray(self.colors @ _GREY)

    def thinned(self, leaf_m: float) -> "Cloud":
        """Return the means of the points in each cube of a grid of `leaf_m` whose corner is the origin."""
        means = cube_means(self.points, np.column_stack([self.points, self.colors]), leaf_m)
        return Cloud(means[:, :3], means[:, 3:])

    def normals(self, radius_m: float) -> Array:
        """Return each point's normal (n x 3, towards the origin), NaN where too few points lie within `radius_m`."""
        sums, counts = scatters(self.points, self.points, Cells.of(self.points, radius_m), False)
        flattest = np.linalg.eigh(sums)[1][:, :, 0]
        flattest[np.einsum("ni,ni->n", flattest, self.points) > 0.0] *= -1.0
        flattest[counts < _LEAST_FOR_A_NORMAL] = np.nan
        return flattest


def cloud_of(color: Image, depth_mm: NDArray[np.uint16], rays: NDArray[np.float32]) -> Cloud:
    """Return the cloud behind the pixels that have depth (H x W, mm, 0: none).

    `color` is H x W x 3 RGB or H x W grey, `rays` (H x W x 2) the normalised coordinates of each pixel (see `Lens`).
    """
    seen = depth_mm > 0
    z = depth_mm[seen] * 1e-3
    points = np.column_stack([rays[seen] * z[:, None], z])
    chosen = color[seen].astype(np.float64)
    return Cloud(points, chosen if chosen.ndim == 2 else np.repeat(chosen[:, None], 3, axis=1))


def cube_means(points: Array, values: Array, leaf_m: float) -> Array:
    """Return the mean of `values` (n x k) over the points in each occupied cube of side `leaf_m`: m x k."""
    if not len(points):
        return np.zeros((0, values.shape[1]))
    cube = np.floor(points / leaf_m).astype(np.int64)
    cube -= cube.min(axis=0)
    size = cube.max(axis=0) + 1
    key = (cube[:, 2] * size[1] + cube[:, 1]) * size[0] + cube[:, 0]
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    counts = np.diff(first, append=len(key))
    return np.asarray(np.add.reduceat(values[order], first, axis=0) / counts[:, None])
