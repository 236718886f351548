"""Which part of a view moves: its surfaces, on a coarse grid, are looked for where earlier views saw free space.

A body that slides across the view is new in part only, so a surface is judged as a whole: cells of the grid belong to
one where each lies on the plane that its neighbour shows.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.measurement import Measurements, measure_exactly, points_of
from odom.frontend.features.view import View
from odom.frontend.matching.look_back import EarlierView, appeared
from odom.frontend.matching.tuning import TUNING
from odom.geometry.arrays import Array, Index, Mask


@dataclass(frozen=True, eq=False)
class DepthGrid:
    """A view's depth at the middles of square cells, row by row; `shape` counts (rows, columns), as `image_shape`.

    `uv` (n x 2 px) are the middles, `measured` (n) what was measured there (NaN: no depth, an
    edge of it, or what may move).
    """

    shape: tuple[int, int]
    image_shape: tuple[int, int]
    uv: Array
    measured: Measurements

    @classmethod
    def of(cls, view: View, sensor: SensorModel, twist: Array) -> "DepthGrid":
        """Return the grid of a view, taken in motion with `twist` (6, SI)."""
        height, width = view.depth_mm.shape
        rows, columns = (max(1, side // TUNING.moving_cell_px) for side in (height, width))
        v, u = ((np.arange(n) + 0.5) * side / n for n, side in ((rows, height), (columns, width)))
        uv = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        measured = measure_exactly(view, sensor, uv, twist)
        measured.values[~view.stands(uv), 2] = np.nan
        return cls((rows, columns), (height, width), uv, measured)

    @cached_property
    def known(self) -> Index:
        """The cells with depth."""
        return np.flatnonzero(self.measured.values[:, 2] > 0.0)

    def surfaces(self) -> NDArray[np.int32]:
        """Return the number of the surface that each cell belongs to (n)."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        cells = np.arange(len(self.uv)).reshape(self.shape)
        a = np.concatenate([cells[:, :-1].ravel(), cells[:-1].ravel()])
        b = np.concatenate([cells[:, 1:].ravel(), cells[1:].ravel()])
        w = self.measured.values[:, 2]
        step = self.uv[b] - self.uv[a]
        ahead = w[a] + np.einsum("ij,ij->i", self.measured.slope[a], step)
        back = w[b] - np.einsum("ij,ij->i", self.measured.slope[b], step)
        gate = TUNING.surface_share * (w[a] + w[b]) / 2.0
        is_one = (np.abs(ahead - w[b]) < gate) & (np.abs(back - w[a]) < gate)
        pairs = coo_array((np.ones(np.count_nonzero(is_one)), (a[is_one], b[is_one])), (len(w), len(w)))
        return np.asarray(connected_components(pairs, directed=False)[1])


@dataclass(frozen=True, eq=False)
class MovingCells:
    """Which cells of a coarse grid over an image of `image_shape` (rows, columns) move: `mask` (rows x columns).

    `share` is their share of the cells with depth.
    """

    mask: Mask
    share: float
    image_shape: tuple[int, int]

    def at(self, uv: Array) -> Mask:
        """Return which of n places in the image (n x 2 px) lie in a cell that moves."""
        cell = (uv[:, ::-1] * np.array(self.mask.shape) / np.array(self.image_shape)).astype(int)
        row, column = np.clip(cell, 0, np.array(self.mask.shape) - 1).T
        return np.asarray(self.mask[row, column])

    def over_image(self) -> Mask:
        """Return the mask of the image's pixels."""
        import cv2

        size = self.image_shape[1], self.image_shape[0]
        return np.asarray(cv2.resize(self.mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0)


def moving_cells(grid: DepthGrid, earlier: list[EarlierView], sensor: SensorModel) -> MovingCells:
    """Return which cells of a view's `grid` show what moved since the `earlier` views."""
    known = grid.known
    positions, covariances = points_of(grid.measured.take(known))
    was_visible, is_new = (np.zeros(len(grid.uv), dtype=np.bool_) for _ in range(2))
    for view in earlier:
        visible, new = appeared(positions, covariances, view, sensor)
        was_visible[known] |= visible
        is_new[known] |= new
    moves = np.zeros(len(grid.uv), dtype=np.bool_)
    if np.count_nonzero(is_new) >= TUNING.moving_cells_least:
        label = grid.surfaces()
        seen_cells, new_cells = np.bincount(label, was_visible), np.bincount(label, is_new)
        least = np.maximum(TUNING.moving_cells_least, TUNING.moving_surface_share * seen_cells)
        is_body = new_cells >= least
        moves = is_body[label]
        moves[~np.isin(np.arange(len(moves)), known)] = False
    share = np.count_nonzero(moves) / max(1, len(known))
    return MovingCells(_closed(moves.reshape(grid.shape)), share, grid.image_shape)


def warm_up() -> None:
    """Import what is needed as soon as something moves, before the first frame."""
    measured = Measurements(np.ones((4, 3)), np.zeros((4, 3, 3)), np.ones((4, 4)), np.zeros((4, 2)))
    _closed(DepthGrid((2, 2), (64, 64), np.zeros((4, 2)), measured).surfaces().reshape(2, 2) > 0)


def _closed(mask: Mask) -> Mask:
    """Return a mask with the cells filled that have moving ones on both sides: depth has holes at edges."""
    import cv2

    filled = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    return np.asarray(filled > 0)
