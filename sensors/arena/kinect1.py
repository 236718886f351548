"""Depth as a Kinect v1 measures it: a projected dot pattern, matched in an infrared image, disparity in eighths.

The chain is simulated, not its published error figures: what the infrared camera sees, what the projector beside it
cannot light (shadow), how much light comes back (range, slope, material), matching over a window (wandering edges,
noise in patches, part of it fixed to the dots), rounding to the 11 bit disparity's step, and the driver's
registration to the colour image.
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
SHAPE = (480, 640)
BASELINE_M = 0.075
"""Projector to infrared camera."""
T_COLOR_INFRARED = np.array([[1, 0, 0, -0.025], [0, 1, 0, 0.0], [0, 0, 1, 0.0], [0, 0, 0, 1.0]])
"""The infrared camera sits 25 mm left of the colour camera."""
STEP = 8.0
"""Disparity steps a pixel."""
K = np.array([FOCAL_PX, FOCAL_PX, *CENTER])


@dataclass(frozen=True)
class Matching:
    """How well the dots are matched, in pixels of disparity and of the image."""

    disparity_px: float = 0.055
    wander_px: float = 0.75
    signal_floor: float = 0.0075
    nearest_m: float = 0.5
    farthest_m: float = 4.6


@compiled
def measure(
    inverse_depth: NDArray[np.float32],
    identity: NDArray[np.int16],
    distance: Array,
    infrared: NDArray[np.float32],
    noise: NDArray[np.float32],
    shifts: NDArray[np.int64],
    matching: tuple[float, float, float, float, float],
    out: NDArray[np.float32],
) -> None:
    """Fill `out` (H x W) with the depth in metres, 0 where no match was found.

    `noise` is 3 tiles of unit deviation: smooth x, smooth y, patches; `shifts` where this frame begins in each.
    """
    disparity_px, wander_px, floor, nearest, farthest = matching
    height, width = inverse_depth.shape
    fb = FOCAL_PX * BASELINE_M
    mask = TILE - 1
    seen_left = np.empty(width)
    lit = np.empty(width, np.bool_)
    for y in range(height):
        leftmost = 1e9
        for x in range(width - 1, -1, -1):
            disparity = fb * inverse_depth[y, x]
            column = x - disparity
            lit[x] = column < leftmost + 0.6
            leftmost = min(leftmost, column)
            seen_left[x] = column
        ry = (y - CENTER[1]) / FOCAL_PX
        for x in range(width):
            out[y, x] = np.float32(0)
            if not lit[x] or identity[y, x] < 0:
                continue
            ty, tx = (y + shifts[0]) & mask, (x + shifts[1]) & mask
            dx = wander_px * noise[0, ty, tx]
            dy = wander_px * noise[1, ty, tx]
            sx, sy = int(np.floor(x + dx + 0.5)), int(np.floor(y + dy + 0.5))
            sx, sy = min(max(sx, 0), width - 1), min(max(sy, 0), height - 1)
            i = identity[sy, sx]
            if i < 0:
                continue
            w = inverse_depth[sy, sx]
            own = inverse_depth[y, x]
            jump = abs(w - own) * fb
            if jump > 1.0 and noise[2, tx, ty] > 0.4:
                continue
            rx = (x - CENTER[0]) / FOCAL_PX
            length2 = 1.0 + rx * rx + ry * ry
            cosine = distance[i] * w / np.sqrt(length2)
            signal = infrared[i] * cosine * w * w / length2
            rough = noise[2, (y + shifts[2]) & mask, (x + shifts[3]) & mask]
            dots = noise[2, y & mask, int(seen_left[x] + 4096.0) & mask]
            if signal * (1.0 + 0.25 * rough) < floor or cosine * (1.0 + 0.2 * rough) < 0.16:
                continue
            sigma = disparity_px * np.sqrt(0.5 + 1.2 * floor / signal + 0.08 / cosine)
            disparity = fb * w + sigma * (0.8 * rough + 0.6 * dots)
            step = np.floor(disparity * STEP + 0.5) / STEP
            if step <= 0.0:
                continue
            z = fb / step
            if z < nearest or z > farthest:
                continue
            out[y, x] = np.float32(z)


@compiled
def register(depth_m: NDArray[np.float32], color: Array, offset: Array, lens: Array, out: NDArray[np.uint16]) -> None:
    """Carry infrared depth into the colour image, the nearest winning, whole millimetres.

    `color` is (fx, fy, cx, cy), `lens` plumb_bob's k1, k2, p1, p2, k3; `offset` the infrared camera in it, metres.
    """
    out[:] = np.uint16(0)
    height, width = depth_m.shape
    bent = lens[0] != 0.0 or lens[1] != 0.0
    for y in range(height):
        for x in range(width):
            z = depth_m[y, x]
            if z <= 0.0:
                continue
            a = (x - CENTER[0]) / FOCAL_PX + offset[0] / z
            b = (y - CENTER[1]) / FOCAL_PX + offset[1] / z
            if bent:
                r2 = a * a + b * b
                radial = 1.0 + r2 * (lens[0] + r2 * (lens[1] + r2 * lens[4]))
                a, b = (
                    a * radial + 2 * lens[2] * a * b + lens[3] * (r2 + 2 * a * a),
                    b * radial + lens[2] * (r2 + 2 * b * b) + 2 * lens[3] * a * b,
                )
            u = int(np.floor(color[0] * a + color[2] + 0.5))
            v = int(np.floor(color[1] * b + color[3] + 0.5))
            if u < 0 or v < 0 or u >= out.shape[1] or v >= out.shape[0]:
                continue
            mm = np.uint16(z * 1000.0 + 0.5)
            if out[v, u] == 0 or mm < out[v, u]:
                out[v, u] = mm


def faulty_depth(
    inverse_depth: NDArray[np.float32],
    identity: NDArray[np.int16],
    distance: Array,
    infrared: NDArray[np.float32],
    tiles: Tiles,
    rng: np.random.Generator,
    camera: Camera,
    matching: Matching | None = None,
) -> NDArray[np.uint16]:
    """Return the registered depth image (mm) of what the infrared camera sees (see `measure`)."""
    m = matching or Matching()
    depth_m = np.empty(SHAPE, np.float32)
    values = (m.disparity_px, m.wander_px, m.signal_floor, m.nearest_m, m.farthest_m)
    measure(inverse_depth, identity, distance, infrared, tiles.patches, rng.integers(0, TILE, 4), values, depth_m)
    return registered(depth_m, camera)


def registered(depth_m: NDArray[np.float32], camera: Camera) -> NDArray[np.uint16]:
    """Return infrared depth (m) in the colour camera's image, millimetres."""
    out = np.empty((camera.height, camera.width), np.uint16)
    lens = np.array((*camera.distortion, 0.0, 0.0, 0.0, 0.0, 0.0)[:5])
    color = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    register(depth_m, color, T_COLOR_INFRARED[:3, 3].copy(), lens, out)
    return out
