"""Light that stays: lamps and window cast soft shadows, corners are darker; baked into the surfaces' pictures."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled
from sensors.arena.paint import STRIPE
from sensors.arena.scene import Panel
from sensors.arena.texture import Image

Array = NDArray[np.float64]

CELL_M = 0.1
"""Spacing of the points where light is gathered, metres."""
REACH_M = 0.9
"""How far away something still dims the ambient light, metres."""
OCCLUDER_M2 = 0.012
"""Smaller surfaces cast no shadow."""
AMBIENT = 0.52
CUBE_M = 0.15
HEMISPHERE_RAYS = 32


@dataclass(frozen=True, eq=False)
class Lamps:
    """Sample points (k x 3), where they shine to (k x 3), and their power (k x 3, RGB, linear).

    A facing surface at r metres gets power / r^2.
    """

    points: Array
    normals: Array
    power: Array


@dataclass(frozen=True, eq=False)
class Blockers:
    """The surfaces that cast shadows, sorted into cubes of CUBE_M: cube c holds `listed[begin[c]:begin[c + 1]]`."""

    origin: Array
    u: Array
    v: Array
    corner: Array
    shape: NDArray[np.int64]
    begin: NDArray[np.int64]
    listed: NDArray[np.int64]


def sort_blockers(panels: list[Panel]) -> Blockers:
    """Return the shadow casting surfaces among `panels`."""
    chosen = [p for p in panels if p.area > OCCLUDER_M2 and p.glow < 5]
    origin, u, v = (np.array([getattr(p, name) for p in chosen]) for name in ("origin", "u", "v"))
    corners = np.stack([origin, origin + u, origin + v, origin + u + v])
    low, high = corners.min(axis=0) - 1e-4, corners.max(axis=0) + 1e-4
    corner = low.min(axis=0)
    shape = np.floor((high.max(axis=0) - corner) / CUBE_M).astype(np.int64) + 1
    first = np.floor((low - corner) / CUBE_M).astype(np.int64)
    last = np.floor((high - corner) / CUBE_M).astype(np.int64)
    cubes, owners = [], []
    for i in range(len(chosen)):
        x, y, z = (np.arange(first[i, k], last[i, k] + 1) for k in range(3))
        where = (x[:, None, None] * shape[1] + y[None, :, None]) * shape[2] + z[None, None, :]
        cubes.append(where.ravel())
        owners.append(np.full(where.size, i))
    cube, owner = np.concatenate(cubes), np.concatenate(owners)
    order = np.argsort(cube, kind="stable")
    begin = np.searchsorted(cube[order], np.arange(int(shape.prod()) + 1))
    return Blockers(origin, u, v, corner, shape, begin.astype(np.int64), owner[order].astype(np.int64))


@compiled
def _meets(p: Array, ray: Array, reach: float, o: Array, u: Array, v: Array) -> bool:
    """Tell whether `p + f ray`, 0 < f < reach, meets the surface at `o` with edges `u` and `v`."""
    nx, ny, nz = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    slope = nx * ray[0] + ny * ray[1] + nz * ray[2]
    if abs(slope) < 1e-12:
        return False
    dx, dy, dz = o[0] - p[0], o[1] - p[1], o[2] - p[2]
    f = (nx * dx + ny * dy + nz * dz) / slope
    if f < 2e-3 or f > reach:
        return False
    hx, hy, hz = f * ray[0] - dx, f * ray[1] - dy, f * ray[2] - dz
    nn = nx * nx + ny * ny + nz * nz
    s = ((hy * v[2] - hz * v[1]) * nx + (hz * v[0] - hx * v[2]) * ny + (hx * v[1] - hy * v[0]) * nz) / nn
    t = ((u[1] * hz - u[2] * hy) * nx + (u[2] * hx - u[0] * hz) * ny + (u[0] * hy - u[1] * hx) * nz) / nn
    return bool(0.0 <= s <= 1.0 and 0.0 <= t <= 1.0)


@compiled
def _blocked(
    p: Array,
    ray: Array,
    reach: float,
    origin: Array,
    u: Array,
    v: Array,
    corner: Array,
    shape: NDArray[np.int64],
    begin: NDArray[np.int64],
    listed: NDArray[np.int64],
    cube: NDArray[np.int64],
    along: Array,
) -> bool:
    """Tell whether anything stands between p and `p + reach ray`, from cube to cube (Amanatides & Woo 1987).

    `cube` (3) and `along` (2 x 3) are room to work in.
    """
    ahead, width = along[0], along[1]
    for r in range(3):
        at = (p[r] - corner[r]) / CUBE_M
        cube[r] = int(np.floor(at))
        if abs(ray[r]) < 1e-12:
            ahead[r], width[r] = 1e30, 1e30
        else:
            width[r] = CUBE_M / abs(ray[r])
            ahead[r] = (cube[r] + 1 - at if ray[r] > 0 else at - cube[r]) * width[r]
    while True:
        if 0 <= cube[0] < shape[0] and 0 <= cube[1] < shape[1] and 0 <= cube[2] < shape[2]:
            c = (cube[0] * shape[1] + cube[1]) * shape[2] + cube[2]
            for k in range(begin[c], begin[c + 1]):
                i = listed[k]
                if _meets(p, ray, reach, origin[i], u[i], v[i]):
                    return True
        r = 0 if ahead[0] < ahead[1] else 1
        r = r if ahead[r] < ahead[2] else 2
        if ahead[r] > reach:
            return False
        cube[r] += 1 if ray[r] > 0 else -1
        ahead[r] += width[r]


@compiled
def gather(
    points: Array,
    normals: Array,
    origin: Array,
    u: Array,
    v: Array,
    corner: Array,
    shape: NDArray[np.int64],
    begin: NDArray[np.int64],
    listed: NDArray[np.int64],
    lamps: Array,
    lamp_normals: Array,
    lamp_power: Array,
    rays: Array,
    spin: Array,
) -> Array:
    """Return the light (m x 3) on m points: from the lamps' sample points, and ambient as far as it is open."""
    out = np.zeros((points.shape[0], 3))
    ray, cube, along = np.empty(3), np.empty(3, np.int64), np.empty((2, 3))
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
            if _blocked(p, ray, 0.985, origin, u, v, corner, shape, begin, listed, cube, along):
                continue
            f = c * e / (rr * (rr + 0.02))
            for r in range(3):
                out[m, r] += f * lamp_power[k, r]
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
            if not _blocked(p, ray, REACH_M, origin, u, v, corner, shape, begin, listed, cube, along):
                free += 1.0
        for r in range(3):
            out[m, r] += AMBIENT * (0.28 + 0.72 * free / rays.shape[0])
    return out


def _grid(panel: Panel) -> tuple[int, int]:
    width, height = np.linalg.norm(panel.u), np.linalg.norm(panel.v)
    if panel.area < OCCLUDER_M2:
        return 1, 1
    return max(2, round(float(height) / CELL_M)), max(2, round(float(width) / CELL_M))


def bake(panels: list[Panel], neighbours: list[Panel], lamps: Lamps, seed: int) -> list[NDArray[np.float32]]:
    """Return coarse maps (rows x columns x 3) of the light on the panels; `neighbours` only cast shadows."""
    rng = np.random.default_rng([seed, 7])
    b = sort_blockers(panels + neighbours)
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
        *(b.origin, b.u, b.v, b.corner, b.shape, b.begin, b.listed),
        *(lamps.points, lamps.normals, lamps.power),
        rays,
        rng.uniform(0, 2 * np.pi, len(everywhere)),
    )
    maps: list[NDArray[np.float32]] = []
    start = 0
    for panel, (rows, columns) in zip(panels, shapes, strict=True):
        part = light[start : start + rows * columns].reshape(rows, columns, 3)
        start += rows * columns
        if panel.glow:
            part = np.full_like(part, panel.glow)
        if rows > 2 and columns > 2:
            part = np.asarray(cv2.GaussianBlur(part, (3, 3), 0.7))
        maps.append(part.astype(np.float32))
    return maps


def lit(image: Image, light: NDArray[np.float32]) -> Image:
    """Return the picture under a coarse map of linear light, in display values (gamma 2.2), soft towards white."""
    height, width = image.shape[:2]
    coarse = light ** (1 / 2.2)
    out = np.empty_like(image)
    for c in range(3):
        value = np.asarray(cv2.resize(coarse[..., c], (width, height), interpolation=cv2.INTER_LINEAR))
        for top in range(0, height, STRIPE):
            rows = slice(top, top + STRIPE)
            part = value[rows] * image[rows, :, c]
            out[rows, :, c] = np.where(part > 200, 200 + 55 * (1 - np.exp(-np.maximum(part - 200, 0) / 55)), part)
    return out
