"""Rotation matrices and unit quaternions (x, y, z, w), one at a time.

scipy's Rotation does the same, but importing it takes 0.2 s, which every process of a rig would pay at its start.
"""

import numpy as np

from odom.errors import InputError
from odom.geometry.arrays import Array

_UNIT = (0.98, 1.02)
"""Squared length that counts as one: messages carry quaternions rounded to a few digits."""


def quaternion_from_rotation(R: Array) -> Array:
    """Return the unit quaternion (x, y, z, w), w >= 0, of a rotation matrix.

    The row of 4 q q^T with the largest diagonal element is q without cancellation (S. W. Shepperd, 1978).
    """
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    products = (
        (1 + a - e - i, b + d, c + g, h - f),
        (b + d, 1 - a + e - i, f + h, c - g),
        (c + g, f + h, 1 - a - e + i, d - b),
        (h - f, c - g, d - b, 1 + a + e + i),
    )
    row = np.array(products[max(range(4), key=lambda k: products[k][k])])
    return np.asarray(row / np.copysign(np.sqrt(row @ row), row[3]))


def rotation_from_quaternion(quaternion: Array) -> Array:
    """Return the rotation matrix of (x, y, z, w); raises InputError unless it is finite and about of unit length."""
    x, y, z, w = (float(value) for value in quaternion)
    norm = x * x + y * y + z * z + w * w
    if not _UNIT[0] < norm < _UNIT[1]:
        raise InputError(f"quaternion {x, y, z, w} is not of unit length")
    s = 2.0 / norm
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
        ]
    )
