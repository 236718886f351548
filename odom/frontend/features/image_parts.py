"""The parts of an image: squares that show how evenly features are spread over it."""

import numpy as np

from odom.geometry.arrays import Array, Index


def parts_of(uv: Array, side_px: int) -> Index:
    """Return the number of the square of `side_px` that each place `uv` (n x 2 px) lies in (n), counted row by row."""
    column, row = (np.maximum(uv, 0.0).astype(np.int64) // side_px).T
    return np.asarray(column + (int(column.max(initial=0)) + 1) * row)
