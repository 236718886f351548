"""Where a lens shows a direction, and how that changes with the direction: the plumb_bob model."""

import numpy as np

from odom.geometry.arrays import Array


def project(xy: Array, lens: Array) -> tuple[Array, Array]:
    """Return the pixels (n x 2) of directions `xy` (n x 2, x/z and y/z), and their derivatives by these (n x 2 x 2).

    `lens` (9): fx, fy, cx, cy, k1, k2, p1, p2, k3. Source: OpenCV's camera model.
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
    return np.column_stack([fx * bent_x + cx, fy * bent_y + cy]), by_direction
