"""Light that stays: lamps and window cast soft shadows, corners are darker; baked into the surfaces' pictures."""

from typing import NamedTuple

import cv2
import numpy as np

from odom.geometry.arrays import Array, Image, Index
from odom.geometry.compiled import compiled
from sensors.arena.array_types import Float32
from sensors.arena.materials import STRIPE
from sensors.arena.scene_builder import Lamps, Panel

CELL_M = 0.1
"""Spacing of the points where light is gathered, metres: finer shadows take longer to prepare, with its square."""
REACH_M = 0.9
"""How far away something still dims the ambient light, metres: farther, rooms get darker and bake longer."""
OCCLUDER_M2 = 0.012
"""Smaller surfaces (square metres) cast no shadow and have one light: smaller, baking takes longer."""
AMBIENT = 0.52
"""Ambient light on a point with nothing near it, linear: larger makes shadows paler."""
CUBE_M = 0.15
"""Side of the cubes that surfaces are sorted into, metres; it decides the time of baking only."""
HEMISPHERE_RAYS = 32
"""Directions in which a point looks for what dims it: fewer are faster and make flat walls patchy."""


class Blockers(NamedTuple):
    """The surfaces that cast shadows, sorted into cubes of CUBE_M: cube c holds `listed[begin[c]:begin[c + 1]]`.

    `surfaces` (n x 13) has each one's origin, edges u and v, their product u x v, and its square |u x v|^2.
    """

    surfaces: Array
    corner: Array
    shape: Index
    begin: Index
    listed: Index


def sort_blockers(panels: list[Panel]) -> Blockers:
    """Return the shadow casting surfaces among `panels`."""
    chosen = [p for p in panels if p.area > OCCLUDER_M2 and p.material.glow < 5]
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
    normal = np.array([p.across for p in chosen])
    square = normal[:, 0] * normal[:, 0] + normal[:, 1] * normal[:, 1] + normal[:, 2] * normal[:, 2]
    surfaces = np.column_stack([origin, u, v, normal, square])
    return Blockers(surfaces, corner, shape, begin.astype(np.int64), owner[order].astype(np.int64))


Triple = tuple[float, float, float] | Array


@compiled
def _cross(a: Triple, b: Triple) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _dot(a: Triple, b: Triple) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _meets(p: Array, ray: Array, reach: float, surface: Array) -> bool:
    """Say whether `p + f ray`, 0 < f < reach, meets a surface: its origin, edges u and v, u x v and |u x v|^2."""
    nx, ny, nz = surface[9], surface[10], surface[11]
    slope = nx * ray[0] + ny * ray[1] + nz * ray[2]
    if abs(slope) < 1e-12:
        return False
    d = (surface[0] - p[0], surface[1] - p[1], surface[2] - p[2])
    f = (nx * d[0] + ny * d[1] + nz * d[2]) / slope
    if f < 2e-3 or f > reach:
        return False
    hit = (f * ray[0] - d[0], f * ray[1] - d[1], f * ray[2] - d[2])
    u, v = (surface[3], surface[4], surface[5]), (surface[6], surface[7], surface[8])
    normal, nn = (nx, ny, nz), surface[12]
    s, t = _dot(_cross(hit, v), normal) / nn, _dot(_cross(u, hit), normal) / nn
    return bool(0.0 <= s <= 1.0 and 0.0 <= t <= 1.0)


@compiled
def _blocked(p: Array, ray: Array, reach: float, blockers: Blockers, cube: Index, along: Array) -> bool:
    """Say whether anything stands between p and `p + reach ray`, from cube to cube (Amanatides & Woo 1987).

    `cube` (3) and `along` (2 x 3) are working memory.
    """
    surfaces, corner, shape, begin, listed = blockers
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
                if _meets(p, ray, reach, surfaces[listed[k]]):
                    return True
        r = 0 if ahead[0] < ahead[1] else 1
        r = r if ahead[r] < ahead[2] else 2
        if ahead[r] > reach:
            return False
        cube[r] += 1 if ray[r] > 0 else -1
        ahead[r] += width[r]


@compiled
def gather(points: Array, normals: Array, blockers: Blockers, lamps: Lamps, rays: Array, spin: Array) -> Array:
    """Return the light (m x 3) on m points with their normals: from the lamps, and ambient as far as it is open.

    `rays` (k x 3, unit length) are spread over the hemisphere about z; each point turns them about its normal by its
    `spin` (m, radians) and counts those that meet nothing within REACH_M.
    """
    out = np.zeros((points.shape[0], 3))
    ray, cube, along = np.empty(3), np.empty(3, np.int64), np.empty((2, 3))
    for m in range(points.shape[0]):
        p, n = points[m], normals[m]
        # the lamps that are seen: both cosines, over the square of the distance (softened near the lamp)
        for k in range(lamps.points.shape[0]):
            for r in range(3):
                ray[r] = lamps.points[k, r] - p[r]
            rr, c, e = _dot(ray, ray), _dot(n, ray), -_dot(lamps.normals[k], ray)
            if c <= 0.0 or e <= 0.0 or _blocked(p, ray, 0.985, blockers, cube, along):
                continue
            f = c * e / (rr * (rr + 0.02))
            for r in range(3):
                out[m, r] += f * lamps.power[k, r]
        # the share of the hemisphere about the normal that is open; a and b complete the normal to axes
        ax, ay, az = _cross(n, (1.0, 0.0, 0.0) if abs(n[0]) < 0.7 else (0.0, 1.0, 0.0))
        norm = np.sqrt(ax * ax + ay * ay + az * az)
        a = (ax / norm, ay / norm, az / norm)
        b = _cross(n, a)
        cs, sn = np.cos(spin[m]), np.sin(spin[m])
        free = 0.0
        for k in range(rays.shape[0]):
            x, y, z = rays[k, 0] * cs - rays[k, 1] * sn, rays[k, 0] * sn + rays[k, 1] * cs, rays[k, 2]
            for r in range(3):
                ray[r] = x * a[r] + y * b[r] + z * n[r]
            if not _blocked(p, ray, REACH_M, blockers, cube, along):
                free += 1.0
        for r in range(3):
            out[m, r] += AMBIENT * (0.28 + 0.72 * free / rays.shape[0])
    return out


def _grid(panel: Panel) -> tuple[int, int]:
    width, height = np.linalg.norm(panel.u), np.linalg.norm(panel.v)
    if panel.area < OCCLUDER_M2:
        return 1, 1
    return max(2, round(float(height) / CELL_M)), max(2, round(float(width) / CELL_M))


def bake(panels: list[Panel], neighbours: list[Panel], lamps: Lamps, seed: int) -> list[Float32]:
    """Return coarse maps (rows x columns x 3) of the light on the panels; `neighbours` only cast shadows."""
    rng = np.random.default_rng([seed, 7])
    points, normals, shapes = [], [], []
    for panel in panels:
        rows, columns = _grid(panel)
        s, t = (np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows
        normal = -panel.across / panel.area
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
        sort_blockers(panels + neighbours),
        lamps,
        rays,
        rng.uniform(0, 2 * np.pi, len(everywhere)),
    )
    maps: list[Float32] = []
    start = 0
    for panel, (rows, columns) in zip(panels, shapes, strict=True):
        part = light[start : start + rows * columns].reshape(rows, columns, 3)
        start += rows * columns
        if panel.material.glow:
            part = np.full_like(part, panel.material.glow)
        if rows > 2 and columns > 2:
            part = np.asarray(cv2.GaussianBlur(part, (3, 3), 0.7))
        maps.append(part.astype(np.float32))
    return maps


def lit(image: Image, light: Float32) -> Image:
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
