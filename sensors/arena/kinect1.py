"""Depth as a Kinect v1 measures it: a projected dot pattern, matched in an infrared image, disparity in eighths.

The chain is simulated, not its published error figures: what the infrared camera sees, what the projector beside it
cannot light (shadow), how much light comes back (range, slope, material), matching over a window (wandering edges,
noise in patches, part of it fixed to the dots), and rounding to the 11 bit disparity's step.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera
from odom.registration.compiled import compiled
from sensors.arena.noise import TILE, Tiles

Array = NDArray[np.float64]

FOCAL_PX = 585.0
CENTER = (318.0, 241.0)
INFRARED = Camera(640, 480, FOCAL_PX, FOCAL_PX, *CENTER)
SHAPE = (INFRARED.height, INFRARED.width)
BASELINE_M = 0.075
"""Projector to infrared camera."""
T_COLOR_INFRARED = np.array([[1, 0, 0, -0.025], [0, 1, 0, 0.0], [0, 0, 1, 0.0], [0, 0, 0, 1.0]])
"""The infrared camera sits 25 mm left of the colour camera."""
STEP = 8.0
"""Disparity steps a pixel."""
RAY_LENGTH2 = np.asarray(
    1
    + ((np.arange(SHAPE[1]) - CENTER[0]) / FOCAL_PX)[None, :] ** 2
    + ((np.arange(SHAPE[0]) - CENTER[1]) / FOCAL_PX)[:, None] ** 2,
    np.float32,
)
INVERSE_LENGTH2 = np.reciprocal(RAY_LENGTH2)


@dataclass(frozen=True)
class Matching:
    """How well the dots are matched: deviation of a good match in pixels, least light, range."""

    disparity_px: float = 0.055
    signal_floor: float = 0.0075
    nearest_m: float = 0.5
    farthest_m: float = 4.6


@compiled
def measure(
    inverse_depth: NDArray[np.float32],
    identity: NDArray[np.int16],
    distance: NDArray[np.float32],
    infrared: NDArray[np.float32],
    inverse_length2: NDArray[np.float32],
    wander: NDArray[np.int8],
    rough: NDArray[np.float32],
    at: tuple[int, int, int, int],
    matching: tuple[np.float32, np.float32, np.float32, np.float32],
    out: NDArray[np.float32],
) -> None:
    """Fill `out` (H x W) with the depth in metres, 0 where no match was found.

    `wander` (2 tiles) is how far off the window catches an edge, whole pixels, and `rough` a tile of patchy noise;
    `at` is where this frame begins in them. `inverse_length2` is 1 over the squared length of the pixels' rays (z = 1).
    A row is worked on in three passes: what is lit, what the window finds, and the arithmetic, without branches.
    """
    disparity_px, floor, nearest, farthest = matching
    height, width = inverse_depth.shape
    zero, one, fb = np.float32(0), np.float32(1), np.float32(FOCAL_PX * BASELINE_M)
    step, half = np.float32(STEP), np.float32(0.5)
    mask = TILE - 1
    seen = np.empty(width, np.bool_)
    found = np.empty((5, width), np.float32)
    for y in range(height):
        leftmost = np.float32(1e9)
        for x in range(width - 1, -1, -1):
            column = np.float32(x) - fb * inverse_depth[y, x]
            seen[x] = column < leftmost + np.float32(0.6)
            leftmost = min(leftmost, column)
        wander_y = (y + at[0]) & mask
        rough_row, dots_row = rough[(y + at[2]) & mask], rough[y & mask]
        for x in range(width):
            tx = (x + at[1]) & mask
            sx = min(max(x + wander[0, wander_y, tx], 0), width - 1)
            sy = min(max(y + wander[1, wander_y, tx], 0), height - 1)
            i = identity[sy, sx]
            seen[x] &= i >= 0
            i = max(i, 0)
            found[0, x] = inverse_depth[sy, sx]
            found[1, x] = distance[i]
            found[2, x] = infrared[i]
            found[3, x] = rough_row[(x + at[3]) & mask]
            column = np.float32(x) - fb * inverse_depth[y, x]
            found[4, x] = dots_row[np.int32(column + np.float32(4096)) & mask]
        for x in range(width):
            w, patch = found[0, x], found[3, x]
            nearness2 = inverse_length2[y, x]
            cosine = found[1, x] * w * np.sqrt(nearness2)
            signal = found[2, x] * cosine * w * w * nearness2
            weak = half + (np.float32(1.2) * floor * cosine + np.float32(0.08) * signal) / (signal * cosine)
            wrong = disparity_px * np.sqrt(weak) * (np.float32(0.8) * patch + np.float32(0.6) * found[4, x])
            steps = np.float32(np.int32((fb * w + wrong) * step + half))
            z = fb * step / steps
            torn = (abs(w - inverse_depth[y, x]) * fb > one) & (patch > np.float32(0.4))
            dim = signal * (one + np.float32(0.25) * patch) < floor
            slant = cosine * (one + np.float32(0.2) * patch) < np.float32(0.16)
            matched = seen[x] & ~(torn | dim | slant) & (steps >= one) & (nearest <= z) & (z <= farthest)
            out[y, x] = z if matched else zero


def measured_depth(
    inverse_depth: NDArray[np.float32],
    identity: NDArray[np.int16],
    distance: Array,
    infrared: NDArray[np.float32],
    tiles: Tiles,
    rng: np.random.Generator,
    matching: Matching | None = None,
) -> NDArray[np.float32]:
    """Return the depth image (m, 0 unknown) of what the infrared camera sees (see `measure`)."""
    m = matching or Matching()
    depth_m = np.empty(SHAPE, np.float32)
    at = rng.integers(0, TILE, 4)
    measure(
        inverse_depth,
        identity,
        distance.astype(np.float32),
        infrared,
        INVERSE_LENGTH2,
        tiles.wander,
        tiles.rough,
        (int(at[0]), int(at[1]), int(at[2]), int(at[3])),
        (np.float32(m.disparity_px), np.float32(m.signal_floor), np.float32(m.nearest_m), np.float32(m.farthest_m)),
        depth_m,
    )
    return depth_m
