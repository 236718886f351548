"""A lens that bends: the picture of a straight, somewhat wider camera looked up where each bent pixel looks."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera
from odom.registration.compiled import compiled
from sensors.arena.color import LANES

MARGIN = 64
"""Pixels that the straight picture is wider on each side."""


def straight(camera: Camera) -> Camera:
    """Return the straight camera whose picture `bent` needs; the camera itself if its lens is straight."""
    if not camera.distortion:
        return camera
    return replace(
        camera,
        width=camera.width + 2 * MARGIN,
        height=camera.height + 2 * MARGIN,
        cx=camera.cx + MARGIN,
        cy=camera.cy + MARGIN,
        distortion=(),
    )


@lru_cache(maxsize=2)
def _lookup(camera: Camera) -> NDArray[np.float32]:
    """Return H x W x 2: where in the straight picture the pixels of the bent one look."""
    k1, k2, p1, p2, k3 = camera.distortion
    v, u = np.mgrid[: camera.height, : camera.width]
    bent_a, bent_b = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    a, b = bent_a, bent_b
    for _ in range(30):
        r2 = a * a + b * b
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        a, b = (
            (bent_a - 2 * p1 * a * b - p2 * (r2 + 2 * a * a)) / radial,
            (bent_b - p1 * (r2 + 2 * b * b) - 2 * p2 * a * b) / radial,
        )
    ideal = straight(camera)
    return np.stack([ideal.fx * a + ideal.cx, ideal.fy * b + ideal.cy], axis=-1).astype(np.float32)


@compiled
def look_up(light: NDArray[np.uint64], where: NDArray[np.float32], out: NDArray[np.uint64]) -> None:
    """Fill `out` with the packed light (see `shading.shade`) at `where`, bilinearly."""
    height, width = light.shape
    for y in range(out.shape[0]):
        for x in range(out.shape[1]):
            s = min(max(where[y, x, 0], np.float32(0)), np.float32(width - 1.01))
            t = min(max(where[y, x, 1], np.float32(0)), np.float32(height - 1.01))
            i, j = int(s), int(t)
            fs, ft = s - np.float32(i), t - np.float32(j)
            packed = np.uint64(0)
            for c in range(3):
                shift = np.uint64(LANES[c])
                a = np.float32(light[j, i] >> shift & np.uint64(0xFFFF))
                b = np.float32(light[j, i + 1] >> shift & np.uint64(0xFFFF))
                d = np.float32(light[j + 1, i] >> shift & np.uint64(0xFFFF))
                e = np.float32(light[j + 1, i + 1] >> shift & np.uint64(0xFFFF))
                top, low = a + (b - a) * fs, d + (e - d) * fs
                packed |= np.uint64(top + (low - top) * ft) << shift
            out[y, x] = packed


def bent(light: NDArray[np.uint64], camera: Camera) -> NDArray[np.uint64]:
    """Return the light on the chip of a camera with a lens, from that of `straight(camera)`."""
    out = np.empty((camera.height, camera.width), np.uint64)
    look_up(light, _lookup(camera), out)
    return out
