"""Depth as a Kinect v1 measures it: a projected dot pattern, matched in an infrared image, disparity in eighths.

The chain is simulated, not its published error figures: what the infrared camera sees, what the projector beside it
cannot light (shadow), how much light comes back (range, slope, material), matching over a window (wandering edges,
noise in patches, part of it fixed to the dots), and rounding to the 11 bit disparity's step.
"""

import numpy as np

from odom.frame import Camera
from odom.geometry.compiled import compiled
from sensors.arena.array_types import Float32
from sensors.arena.noise_tiles import TILE, Tiles
from sensors.arena.renderer import DepthView

FOCAL_PX, CENTER = 585.0, (318.0, 241.0)
"""Focal length and principal point of the infrared camera, pixels."""
INFRARED = Camera(640, 480, FOCAL_PX, FOCAL_PX, *CENTER)
"""The infrared camera, pixels: a typical calibration of a Kinect v1."""
SHAPE = (INFRARED.height, INFRARED.width)
BASELINE_M = 0.075
"""Projector to infrared camera, metres, as drivers assume it; longer, depth gets finer and shadows wider."""
T_COLOR_INFRARED = np.array([[1, 0, 0, -0.025], [0, 1, 0, 0.0], [0, 0, 1, 0.0], [0, 0, 0, 1.0]])
"""The infrared camera sits 25 mm left of the colour camera, as in the device."""
STEP = 8.0
"""Disparity steps per pixel (the sensor's 11 bit values)."""
DISPARITY_PX = 0.055
"""Deviation of a good match, pixels; depth noise is proportional to it.

Set so that noise is 1 to 3 mm at 1 m and grows with the square of depth (tests/arena/test_arena_depth.py).
"""
LEAST_SIGNAL = 0.0075
"""Light, relative to a white surface at 1 m, below which no dots are found: larger, dark things vanish nearer."""
NEAREST_M, FARTHEST_M = np.float32(0.5), np.float32(4.6)
"""Range of the sensor, metres as drivers deliver it; what is outside is 0."""


def _inverse_length2() -> Float32:
    """Return 1 over the squared length of each pixel's ray of depth 1."""
    x, y = ((np.arange(SHAPE[1 - k]) - CENTER[k]) / FOCAL_PX for k in (0, 1))
    return np.reciprocal(np.asarray(1 + x[None, :] ** 2 + y[:, None] ** 2, np.float32))


INVERSE_LENGTH2 = _inverse_length2()


@compiled
def measure(
    view: DepthView, infrared: Float32, inverse_length2: Float32, tiles: Tiles, at: tuple[int, ...], out: Float32
) -> None:
    """Fill `out` (H x W) with the depth in metres, 0 where no match was found.

    `infrared` (n) is what the surfaces send back. `tiles.wander` is how far off the window catches an edge, whole
    pixels, and `tiles.rough` patchy noise; `at` is where this frame begins in them.
    A row is worked on in three passes: what is lit, what the window finds, and the arithmetic, without branches.
    """
    inverse_depth, identity, distance = view
    wander, rough = tiles.wander, tiles.rough
    disparity_px, floor = np.float32(DISPARITY_PX), np.float32(LEAST_SIGNAL)
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
            matched = seen[x] & ~(torn | dim | slant) & (steps >= one) & (z >= NEAREST_M) & (z <= FARTHEST_M)
            out[y, x] = z if matched else zero


def measured_depth(view: DepthView, infrared: Float32, tiles: Tiles, rng: np.random.Generator) -> Float32:
    """Return the depth image (m, 0 unknown) of what the infrared camera sees (see `measure`)."""
    depth_m = np.empty(SHAPE, np.float32)
    measure(view, infrared, INVERSE_LENGTH2, tiles, tuple(rng.integers(0, TILE, 4).tolist()), depth_m)
    return depth_m
