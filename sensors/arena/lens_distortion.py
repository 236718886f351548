"""A lens with distortion: where its pixels look in the picture of a somewhat wider camera without distortion."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from odom.frame import Camera
from sensors.arena.array_types import Float32

MARGIN = 12
"""Pixels that the straight picture is wider on each side: 3 for the lens, the rest for a rolling shutter's motion.

Narrower, fast turns smear the picture's edge; wider draws more that is not seen.
"""


def straight(camera: Camera) -> Camera:
    """Return the wider camera without distortion in whose picture `lookup` finds the pixels."""
    return replace(
        camera,
        width=camera.width + 2 * MARGIN,
        height=camera.height + 2 * MARGIN,
        cx=camera.cx + MARGIN,
        cy=camera.cy + MARGIN,
        distortion=(),
    )


@lru_cache(maxsize=2)
def lookup(camera: Camera) -> Float32:
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
