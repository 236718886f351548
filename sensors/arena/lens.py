"""A lens that bends: where each of its pixels looks in the picture of a straight, somewhat wider camera."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera

MARGIN = 12
"""Pixels that the straight picture is wider on each side: 3 for the lens, the rest for a rolling shutter's motion."""


def straight(camera: Camera) -> Camera:
    """Return the straight, wider camera whose picture `lookup` speaks of."""
    return replace(
        camera,
        width=camera.width + 2 * MARGIN,
        height=camera.height + 2 * MARGIN,
        cx=camera.cx + MARGIN,
        cy=camera.cy + MARGIN,
        distortion=(),
    )


@lru_cache(maxsize=2)
def lookup(camera: Camera) -> NDArray[np.float32]:
    """Return 2 x H x W: where (x, y) in the picture of `straight(camera)` the pixels of the camera look."""
    k1, k2, p1, p2, k3 = camera.distortion or (0.0,) * 5
    v, u = np.ogrid[: camera.height, : camera.width]
    bent_a, bent_b = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    a, b = bent_a, bent_b
    for _ in range(30 if camera.distortion else 0):
        r2 = a * a + b * b
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        a, b = (
            (bent_a - 2 * p1 * a * b - p2 * (r2 + 2 * a * a)) / radial,
            (bent_b - p1 * (r2 + 2 * b * b) - 2 * p2 * a * b) / radial,
        )
    ideal = straight(camera)
    x, y = ideal.fx * a + ideal.cx, ideal.fy * b + ideal.cy
    out = np.empty((2, camera.height, camera.width), np.float32)
    out[0], out[1] = np.clip(x, 0, ideal.width - 1), np.clip(y, 0, ideal.height - 1)
    return out
