"""Light that stays: lamps and window cast soft shadows, corners are darker; baked into the surfaces' pictures."""

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled
from sensors.arena.scene import Panel
from sensors.arena.texture import Image

Array = NDArray[np.float64]

CELL_M = 0.09
"""Spacing of the points where light is gathered, metres."""
REACH_M = 0.9
"""How far away something still dims the ambient light, metres."""
OCCLUDER_M2 = 0.012
"""Smaller surfaces cast no shadow."""
AMBIENT = 0.52
HEMISPHERE_RAYS = 32


@compiled
def _blocked(p: Array, ray: Array, reach: float, origin: Array, u: Array, v: Array, at: NDArray[np.int64]) -> bool:
    """Tell whether `p + f ray`, 0 < f < reach, meets one of the surfaces `at`."""
    for i in at:
        nx = u[i, 1] * v[i, 2] - u[i, 2] * v[i, 1]
        ny = u[i, 2] * v[i, 0] - u[i, 0] * v[i, 2]
        nz = u[i, 0] * v[i, 1] - u[i, 1] * v[i, 0]
        slope = nx * ray[0] + ny * ray[1] + nz * ray[2]
        if abs(slope) < 1e-12:
            continue
        dx, dy, dz = origin[i, 0] - p[0], origin[i, 1] - p[1], origin[i, 2] - p[2]
        f = (nx * dx + ny * dy + nz * dz) / slope
        if f < 2e-3 or f > reach:
            continue
        hx, hy, hz = f * ray[0] - dx, f * ray[1] - dy, f * ray[2] - dz
        nn = nx * nx + ny * ny + nz * nz
        s = (
            (hy * v[i, 2] - hz * v[i, 1]) * nx + (hz * v[i, 0] - hx * v[i, 2]) * ny + (hx * v[i, 1] - hy * v[i, 0]) * nz
        ) / nn
        t = (
            (u[i, 1] * hz - u[i, 2] * hy) * nx + (u[i, 2] * hx - u[i, 0] * hz) * ny + (u[i, 0] * hy - u[i, 1] * hx) * nz
        ) / nn
        if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
            return True
    return False


@compiled
def gather(
    points: Array,
    normals: Array,
    origin: Array,
    u: Array,
    v: Array,
    middle: Array,
    radius: Array,
    lamps: Array,
    lamp_normals: Array,
    lamp_power: Array,
    rays: Array,
    spin: Array,
) -> Array:
    """Return the light (m x 3) on m points: from the lamps' sample points, and ambient as far as the sky is open."""
    out = np.zeros((points.shape[0], 3))
    everything = np.arange(origin.shape[0])
    near = np.empty(origin.shape[0], np.int64)
    ray = np.empty(3)
    for m in range(points.shape[0]):
        p, n = points[m], normals[m]
        for k in range(lamps.shape[0]):
            for r in range(3):
                ray[r] = lamps[k, r] - p[r]
            rr = ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2]
            c = n[0] * ray[0] + n[1] * ray[1] + n[2] * ray[2]
            e = -(lamp_normals[k, 0] * ray[0] + lamp_normals[k, 1] * ray[1] + lamp_normals[k, 2] * ray[2])
            if c <= 0.0 or e <= 0.0:
                continue
            if _blocked(p, ray, 0.985, origin, u, v, everything):
                continue
            f = c * e / (rr * (rr + 0.02))
            for r in range(3):
                out[m, r] += f * lamp_power[k, r]
        count = 0
        for i in range(origin.shape[0]):
            dx, dy, dz = middle[i, 0] - p[0], middle[i, 1] - p[1], middle[i, 2] - p[2]
            if dx * dx + dy * dy + dz * dz < (radius[i] + 0.9) ** 2:
                near[count] = i
                count += 1
        hx, hy, hz = (1.0, 0.0, 0.0) if abs(n[0]) < 0.7 else (0.0, 1.0, 0.0)
        ax, ay, az = n[1] * hz - n[2] * hy, n[2] * hx - n[0] * hz, n[0] * hy - n[1] * hx
        norm = np.sqrt(ax * ax + ay * ay + az * az)
        ax, ay, az = ax / norm, ay / norm, az / norm
        bx, by, bz = n[1] * az - n[2] * ay, n[2] * ax - n[0] * az, n[0] * ay - n[1] * ax
        cs, sn = np.cos(spin[m]), np.sin(spin[m])
        free = 0.0
        for k in range(rays.shape[0]):
            x, y, z = rays[k, 0] * cs - rays[k, 1] * sn, rays[k, 0] * sn + rays[k, 1] * cs, rays[k, 2]
            ray[0] = x * ax + y * bx + z * n[0]
            ray[1] = x * ay + y * by + z * n[1]
            ray[2] = x * az + y * bz + z * n[2]
            if not _blocked(p, ray, 0.9, origin, u, v, near[:count]):
                free += 1.0
        for r in range(3):
            out[m, r] += 0.52 * (0.28 + 0.72 * free / rays.shape[0])
    return out


def _grid(panel: Panel) -> tuple[int, int]:
    width, height = np.linalg.norm(panel.u), np.linalg.norm(panel.v)
    if panel.area < OCCLUDER_M2:
        return 1, 1
    return max(2, round(float(height) / CELL_M)), max(2, round(float(width) / CELL_M))


def bake(panels: list[Panel], lamps: Array, lamp_normals: Array, lamp_power: Array, seed: int) -> list[Image]:
    """Return the panels' pictures as the lamps light them.

    `lamps` (k x 3) are points on the lamps, `lamp_normals` where they shine to, `lamp_power` (k x 3, RGB, linear)
    what they give: a facing surface at r metres gets power / r^2. Panels that share a picture share its light.
    """
    rng = np.random.default_rng([seed, 7])
    blockers = [p for p in panels if p.area > OCCLUDER_M2 and p.glow < 5]
    origin, u, v = (np.array([getattr(p, name) for p in blockers]) for name in ("origin", "u", "v"))
    middle, radius = origin + (u + v) / 2, np.linalg.norm(u, axis=1) / 2 + np.linalg.norm(v, axis=1) / 2
    points, normals, shapes = [], [], []
    for panel in panels:
        rows, columns = _grid(panel)
        s, t = (np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows
        normal = -np.cross(panel.u, panel.v)
        normal /= np.linalg.norm(normal)
        grid = panel.origin + t[:, None, None] * panel.v + s[None, :, None] * panel.u + 0.004 * normal
        points.append(grid.reshape(-1, 3))
        normals.append(np.broadcast_to(normal, (rows * columns, 3)))
        shapes.append((rows, columns))
    k = np.arange(HEMISPHERE_RAYS) + 0.5
    rise, turn = np.sqrt(1 - k / HEMISPHERE_RAYS), np.pi * (1 + 5**0.5) * k
    flat = np.sqrt(k / HEMISPHERE_RAYS)
    rays = np.stack([flat * np.cos(turn), flat * np.sin(turn), rise], axis=1)
    everywhere = np.concatenate(points)
    light = gather(
        everywhere,
        np.concatenate(normals),
        origin,
        u,
        v,
        middle,
        radius,
        lamps,
        lamp_normals,
        lamp_power,
        rays,
        rng.uniform(0, 2 * np.pi, len(everywhere)),
    )
    baked, start = [], 0
    for panel, (rows, columns) in zip(panels, shapes, strict=True):
        part = light[start : start + rows * columns].reshape(rows, columns, 3)
        start += rows * columns
        if panel.glow:
            part = np.full_like(part, panel.glow)
        if rows > 2 and columns > 2:
            part = cv2.GaussianBlur(part, (3, 3), 0.7)
        baked.append(_lit(panel.image, part.astype(np.float32)))
    return baked


def _lit(image: Image, light: NDArray[np.float32]) -> Image:
    """Return the picture under a coarse map of linear light, in display values (gamma 2.2), soft towards white."""
    height, width = image.shape[:2]
    factor = np.asarray(cv2.resize(light ** (1 / 2.2), (width, height), interpolation=cv2.INTER_LINEAR))
    value = image * factor
    return np.asarray(np.where(value > 200, 200 + 55 * (1 - np.exp(-(value - 200) / 55)), value), np.uint8)
