"""The array types that every package shares: numpy arrays by what their entries are."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Scalar = TypeVar("Scalar", bound=np.generic)

Array = NDArray[np.float64]
"""Numbers: points, poses, covariances."""
Index = NDArray[np.int64]
"""Whole numbers that name rows, key frames or landmarks."""
Mask = NDArray[np.bool_]
"""One truth value for each row."""
Image = NDArray[np.uint8]
"""Grey (H x W) or RGB (H x W x 3) pixels."""


def uniform(image: NDArray[Scalar]) -> NDArray[Scalar]:
    """Return an image row by row without gaps, not to be written; copied only where it is stored otherwise.

    Compiled loops are compiled for each way of storing they meet, which takes a second of a running stream. Images come
    read-only from the wire, with gaps from padded rows, and writable from a file.
    """
    out = np.require(image, requirements=["C", "A"]).view()
    out.flags.writeable = False
    return out


def rounded(numbers: Array) -> Array:
    """Return numbers rounded to 24 bits, as files keep them where no more of them is known."""
    return numbers.astype(np.float32).astype(np.float64)


def kept(image: NDArray[Scalar]) -> NDArray[Scalar]:
    """Return a copy of an image, stored as by `uniform`: a program may write its next one into the same memory."""
    return uniform(np.array(image, order="C"))
