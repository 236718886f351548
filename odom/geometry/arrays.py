"""The array types that every package shares: numpy arrays by what their entries are."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers: points, poses, covariances."""
Index = NDArray[np.int64]
"""Whole numbers that name rows, key frames or landmarks."""
Mask = NDArray[np.bool_]
"""One truth value for each row."""
Image = NDArray[np.uint8]
"""Grey (H x W) or RGB (H x W x 3) pixels."""
