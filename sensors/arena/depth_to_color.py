"""Registers the infrared camera's depth to the colour image beside it, as the sensor's driver does."""

import numpy as np

from odom.frame import Camera
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled
from sensors.arena.array_types import DepthImage, Float32


def intrinsics(camera: Camera) -> Array:
    """Return (fx, fy, cx, cy)."""
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy])


@compiled
def register(depth_m: Float32, infrared: Array, color: Array, offset: Array, lens: Array, out: DepthImage) -> None:
    """Carry infrared depth into the colour image, the nearest winning, whole millimetres.

    `infrared` and `color` are (fx, fy, cx, cy), `lens` plumb_bob's k1, k2, p1, p2, k3; `offset` is the
    infrared camera in the colour camera's frame, metres.
    """
    out[:] = np.uint16(0)
    height, width = depth_m.shape
    rows, columns = out.shape
    bent = lens[0] != 0.0 or lens[1] != 0.0
    ray_x = (np.arange(width) - infrared[2]) / infrared[0]
    place = np.empty((2, width), np.int32)
    for y in range(height):
        ray_y = (y - infrared[3]) / infrared[1]
        for x in range(width):
            nearness = 1.0 / depth_m[y, x]
            a, b = ray_x[x] + offset[0] * nearness, ray_y + offset[1] * nearness
            if bent:
                r2 = a * a + b * b
                radial = 1.0 + r2 * (lens[0] + r2 * (lens[1] + r2 * lens[4]))
                a, b = (
                    a * radial + 2 * lens[2] * a * b + lens[3] * (r2 + 2 * a * a),
                    b * radial + lens[2] * (r2 + 2 * b * b) + 2 * lens[3] * a * b,
                )
            place[0, x] = np.int32(color[0] * a + color[2] + 0.5)
            place[1, x] = np.int32(color[1] * b + color[3] + 0.5)
        for x in range(width):
            z, u, v = depth_m[y, x], place[0, x], place[1, x]
            if z <= np.float32(0) or u < 0 or v < 0 or u >= columns or v >= rows:
                continue
            mm = np.uint16(z * np.float32(1000) + np.float32(0.5))
            there = out[v, u]
            if there == 0 or mm < there:
                out[v, u] = mm


def to_color(depth_m: Float32, infrared: Camera, camera: Camera, T_color_infrared: Array) -> DepthImage:
    """Return infrared depth (m, 0 unknown) in the image of the colour `camera`, mm; the two look the same way."""
    out = np.empty((camera.height, camera.width), np.uint16)
    lens = np.array((*camera.distortion, 0.0, 0.0, 0.0, 0.0, 0.0)[:5])
    register(depth_m, intrinsics(infrared), intrinsics(camera), T_color_infrared[:3, 3].copy(), lens, out)
    return out
