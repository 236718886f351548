"""Images of 16 bits a sample, as infrared cameras give them, in the 8 bits in which features are looked for."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from odom.geometry.arrays import Image
from odom.wire.codec.image_files import OtherFormatError

_SAMPLED_EVERY = 4
"""Distance of the sampled pixels both ways: 19,200 of a VGA image tell how bright it is."""
_BRIGHT = 0.97
"""Share of the pixels whose bits count as in use: more, and reflexes leave the rest of the image dark."""


def in_eight_bits(image: NDArray[Any]) -> Image:
    """Return an image (H x W or H x W x 3 uint16, any byte order) as uint8: the upper eight of the bits in use.

    A sensor of ten or twelve bits leaves the upper ones empty; cut to the upper eight of sixteen, its images would be
    black. Whole bits are cut, so that brightness does not tremble; what is brighter than the bits in use is white. An
    image that is uint8 is returned as it is. Raises OtherFormatError for numbers of another type.
    """
    if image.dtype == np.uint8:
        return np.asarray(image, dtype=np.uint8)
    if image.dtype.kind != "u" or image.dtype.itemsize != 2:
        raise OtherFormatError(f"samples of type {image.dtype}: give 8 or 16 bits a sample")
    sample = image[::_SAMPLED_EVERY, ::_SAMPLED_EVERY]
    bits = int(np.quantile(sample, _BRIGHT)).bit_length() if sample.size else 0
    return np.asarray(np.minimum(image >> max(bits - 8, 0), 255), dtype=np.uint8)
