"""The array types of the arena, beside those that every package shares."""

import numpy as np
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
"""Numbers of single precision: depths, noise, gains."""
Light = NDArray[np.uint64]
"""H x W: 256 times the 8 bit colour of each pixel in lanes of 16 bits, red lowest, then blue, then green."""
DepthImage = NDArray[np.uint16]
"""H x W millimetres along the optical axis, 0 where nothing was measured."""
Identity = NDArray[np.int16]
"""H x W: the number of the surface that each pixel sees, -1 for none."""
