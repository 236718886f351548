"""A rolling shutter: a colour chip is read out row by row, so each row shows another instant than the one above.

The picture is drawn once, as the camera at its middle row's instant sees it; then each pixel is looked up where the ray
that its row saw met that picture. Approximations: the path during the readout is a parabola through three poses; the
depth that a ray meets is that of the drawn picture (one step of a fixed-point search); what is hidden behind a near
thing there stays hidden, a pixel or two at most at walking speed.
"""

import numpy as np

from odom.frame import Camera
from odom.geometry.compiled import compiled
from odom.geometry.se3 import inverse
from sensors.arena.array_types import Float32, Light
from sensors.arena.camera_path import Walk

READOUT_S = 0.027
"""Seconds from the first row of a colour image to the last; an image is stamped when it is complete.

Most of the 33 ms that a frame lasts at 30 Hz, as in both Kinects; longer, fast turns shear the picture more.
"""

_LANE, _UNIT = np.uint64(0xFFFF), 1 << 8
"""Bits of a lane of packed light, and the fixed point unit of weights between pixels."""


def row_motion(walk: Walk, t: float, wide: Camera, height: int) -> Float32:
    """Return height x 3 x 4: how each row of an image sees the picture drawn by the camera `wide` at `t`.

    `A @ (u, v, 1, w)` is, up to scale, the pixel of the picture at which a row finds what it sees at pixel (u, v) of
    the same `wide` camera and at inverse depth `w`; `t` is the instant of row height / 2, seconds of the walk.
    """
    world_to_middle = inverse(walk.T_world_camera(t))
    first, last = (world_to_middle @ walk.T_world_camera(t + side * READOUT_S / 2) for side in (-1, 1))
    s = (2 * np.arange(height) / height - 1)[:, None, None]
    T = np.eye(4) + s * (last - first) / 2 + s * s * ((last + first) / 2 - np.eye(4))
    P = wide.matrix @ T[:, :3]
    P[:, :, :3] = P[:, :, :3] @ np.linalg.inv(wide.matrix)
    return P.astype(np.float32)


def no_motion(height: int) -> Float32:
    """Return the `row_motion` of a camera whose rows are all exposed at once."""
    return np.broadcast_to(np.eye(3, 4, dtype=np.float32), (height, 3, 4)).copy()


@compiled
def look_up(light: Light, inverse_depth: Float32, where: Float32, motion: Float32, out: Light) -> None:
    """Fill `out` (H x W) with the light of the drawn picture, bilinearly.

    `where` (2 x H x W) is the pixel of the drawn picture at which a pixel of the chip looks through its lens, and
    `motion` (H x 3 x 4, see `row_motion`) what the rows' instants change about it. Each row is worked on in passes:
    the depth at the pixel, twice the place that this depth leads to, its four neighbours, and their weighted mean.
    """
    height, width = light.shape
    zero, one, half, unit = np.float32(0), np.float32(1), np.float32(0.5), np.float32(_UNIT)
    high_s, high_t = np.float32(width - 1.01), np.float32(height - 1.01)
    columns = out.shape[1]
    found = np.empty((3, columns), np.float32)
    place = np.empty((3, columns), np.int32)
    around = np.empty((4, columns), np.uint64)
    lights, depths = light.reshape(-1), inverse_depth.reshape(-1)
    for y in range(out.shape[0]):
        m = motion[y]
        for x in range(columns):
            found[0, x] = depths[np.int32(where[1, y, x] + half) * width + np.int32(where[0, y, x] + half)]
        for step in range(2):
            for x in range(columns):
                u, v, w = where[0, y, x], where[1, y, x], found[0, x]
                scale = one / (m[2, 0] * u + m[2, 1] * v + m[2, 2] + m[2, 3] * w)
                s = (m[0, 0] * u + m[0, 1] * v + m[0, 2] + m[0, 3] * w) * scale
                t = (m[1, 0] * u + m[1, 1] * v + m[1, 2] + m[1, 3] * w) * scale
                found[1, x] = min(max(s, zero), high_s)
                found[2, x] = min(max(t, zero), high_t)
            if step == 0:
                for x in range(columns):
                    found[0, x] = depths[np.int32(found[2, x] + half) * width + np.int32(found[1, x] + half)]
        for x in range(columns):
            i, j = np.int32(found[1, x]), np.int32(found[2, x])
            place[0, x] = j * width + i
            place[1, x] = np.int32((found[1, x] - np.float32(i)) * unit + half)
            place[2, x] = np.int32((found[2, x] - np.float32(j)) * unit + half)
        for x in range(columns):
            at = np.uint64(place[0, x])
            below = at + np.uint64(width)
            around[0, x], around[1, x] = lights[at], lights[at + np.uint64(1)]
            around[2, x], around[3, x] = lights[below], lights[below + np.uint64(1)]
        for x in range(columns):
            fx, fy = np.uint32(place[1, x]), np.uint32(place[2, x])
            gx, gy = np.uint32(_UNIT - fx), np.uint32(_UNIT - fy)
            w00, w10, w01, w11 = np.uint32(gx * gy), np.uint32(fx * gy), np.uint32(gx * fy), np.uint32(fx * fy)
            a, b, c, d = around[0, x], around[1, x], around[2, x], around[3, x]
            total = np.uint64(0)
            for lane in range(0, 48, 16):
                shift = np.uint64(lane)
                mixed = np.uint32(
                    np.uint32(a >> shift & _LANE) * w00
                    + np.uint32(b >> shift & _LANE) * w10
                    + np.uint32(c >> shift & _LANE) * w01
                    + np.uint32(d >> shift & _LANE) * w11
                )
                total |= np.uint64(mixed >> np.uint32(16)) << shift
            out[y, x] = total
