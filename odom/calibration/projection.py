"""Where a lens shows a direction, and how that changes with direction and lens: the plumb_bob model."""

import numpy as np

from odom.geometry.arrays import Array


def project(xy: Array, lens: Array) -> tuple[Array, Array, Array]:
    """Return the pixels (n x 2) of directions `xy` (n x 2, x/z and y/z), and their derivatives.

    By the direction (n x 2 x 2) and by `lens` (n x 2 x 9): fx, fy, cx, cy, k1, k2, p1, p2, k3.
    Source: OpenCV's camera model.
    """
    fx, fy, cx, cy, k1, k2, p1, p2, k3 = lens
    x, y = xy.T
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    by_r2 = k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3)
    bent_x = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    bent_y = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    by_direction = np.empty((len(xy), 2, 2))
    by_direction[:, 0, 0] = fx * (radial + 2.0 * x * x * by_r2 + 2.0 * p1 * y + 6.0 * p2 * x)
    across = 2.0 * x * y * by_r2 + 2.0 * p1 * x + 2.0 * p2 * y
    by_direction[:, 0, 1], by_direction[:, 1, 0] = fx * across, fy * across
    by_direction[:, 1, 1] = fy * (radial + 2.0 * y * y * by_r2 + 6.0 * p1 * y + 2.0 * p2 * x)
    by_lens = np.zeros((len(xy), 2, 9))
    by_lens[:, 0, 0], by_lens[:, 1, 1] = bent_x, bent_y
    by_lens[:, 0, 2] = by_lens[:, 1, 3] = 1.0
    for axis, reach in ((0, fx * x), (1, fy * y)):
        for column, power in ((4, r2), (5, r2**2), (8, r2**3)):
            by_lens[:, axis, column] = reach * power
    by_lens[:, 0, 6], by_lens[:, 0, 7] = fx * 2.0 * x * y, fx * (r2 + 2.0 * x * x)
    by_lens[:, 1, 6], by_lens[:, 1, 7] = fy * (r2 + 2.0 * y * y), fy * 2.0 * x * y
    return np.column_stack([fx * bent_x + cx, fy * bent_y + cy]), by_direction, by_lens
