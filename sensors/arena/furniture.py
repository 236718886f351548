"""Things of the laboratory whose parts depend on each other's random sizes, and so cannot stand in laboratory.yaml.

Each stands on z = 0 of its own frame and looks along -y.
"""

import numpy as np

from odom.geometry.arrays import Array, Image
from sensors.arena.goods import carton, spine
from sensors.arena.materials import Color, Painter, Random, plain, some_color
from sensors.arena.prints import poster
from sensors.arena.scene_builder import Material, Scene, Vector, pose


def one_of(rng: Random, colors: tuple[Color, ...]) -> Color:
    """Return one of the colours."""
    return colors[int(rng.integers(len(colors)))]


def books(scene: Scene, rng: Random, T: Array, width: float, height: float, depth: float) -> None:
    """Add a row of standing books and binders, `height` the room above the shelf."""
    x = -width / 2
    while True:
        thick = rng.uniform(0.018, 0.065)
        if x + thick > width / 2:
            return
        if rng.random() < 0.1:
            x += rng.uniform(0.04, 0.12)
            continue
        tall = rng.uniform(0.6, 0.93) * height
        deep = rng.uniform(0.75, 1.0) * depth
        special = {
            "front": Material(spine(rng)),
            "left": Material(plain(rng, some_color(rng), 0.01)),
            "right": Material(plain(rng, some_color(rng), 0.01)),
        }
        center, size = (x + thick / 2, depth / 2 - deep / 2, tall / 2), (thick - 0.002, deep, tall)
        page = Material(plain(rng, (222, 214, 194), 0.008, 0.05))
        scene.box(T, center, size, page, "front left right top", special)
        x += thick


def quarter_turned(painter: Painter) -> Painter:
    """Return a painter of the same picture, turned by 90 degrees."""

    def paint(width_m: float, height_m: float) -> Image:
        return np.ascontiguousarray(np.rot90(painter(height_m, width_m)))

    return paint


def pile_of_books(scene: Scene, rng: Random, T: Array, count: int) -> None:
    """Lay books on each other."""
    z = 0.0
    for _ in range(count):
        w, d, h = rng.uniform(0.2, 0.3), rng.uniform(0.15, 0.22), rng.uniform(0.02, 0.05)
        at = T @ pose(0, 0, 0, rng.uniform(-25, 25))
        cover = poster(rng, 0.0025) if rng.random() < 0.5 else plain(rng, some_color(rng))
        special = {"front": Material(quarter_turned(spine(rng))), "top": Material(cover)}
        scene.box(at, (0, 0, z + h / 2), (w, d, h - 0.002), Material(plain(rng, (225, 218, 200))), special=special)
        z += h


def shelf_boards(
    scene: Scene, rng: Random, T: Array, width: float, height: float, depth: float, paint: Material
) -> None:
    """Add the boards of a shelf, some 0.36 m above each other, with books or cartons on them."""
    levels = max(2, round(height / 0.36))
    gap = (height - 0.02) / levels
    for k in range(levels + 1):
        z = k * gap
        scene.box(T, (0, 0, z + 0.01), (width - 0.04, depth, 0.02), paint, "front top bottom")
        if k == levels:
            break
        on = T @ pose(0, 0, z + 0.021)
        if rng.random() < 0.72:
            books(scene, rng, on @ pose(0, 0.02), width - 0.06, gap - 0.04, depth - 0.08)
        else:
            for x in np.arange(-width / 2 + 0.17, width / 2 - 0.12, 0.3):
                size = (rng.uniform(0.16, 0.26), depth - 0.08, rng.uniform(0.5, 0.85) * (gap - 0.04))
                scene.box(on, (x, 0, size[2] / 2), size, Material(carton(rng)))


def stack_of_cartons(scene: Scene, rng: Random, T: Array, count: int) -> None:
    """Add cardboard boxes on each other."""
    z = 0.0
    for _ in range(count):
        size = (rng.uniform(0.32, 0.52), rng.uniform(0.3, 0.42), rng.uniform(0.22, 0.38))
        at = T @ pose(0, 0, 0, rng.uniform(-14, 14))
        scene.box(at, (0, 0, z + size[2] / 2), size, Material(carton(rng)))
        z += size[2] + 0.001


def leaves(scene: Scene, rng: Random, T: Array, size: float) -> None:
    """Add the pointed leaves of a plant."""
    for k in range(34):
        a = k * 2.4 + rng.uniform(-0.3, 0.3)
        rise = rng.uniform(0.15, 1.25)
        length = size * rng.uniform(0.45, 0.95)
        out = np.array([np.cos(a) * np.cos(rise), np.sin(a) * np.cos(rise), np.sin(rise)])
        wide = np.cross(out, (0, 0, 1.0))
        wide *= 0.13 * length / np.linalg.norm(wide)
        root = np.array([0.06 * np.cos(a), 0.06 * np.sin(a), 0.5]) * size
        green: Color = (int(rng.integers(40, 90)), int(rng.integers(105, 160)), int(rng.integers(38, 70)))
        leaf = Material(plain(rng, green, 0.008, 0.12), two_sided=True)
        middle = out * length / 2
        scene.panel(T, root + middle, middle + wide, middle - wide, leaf)


def cable(scene: Scene, rng: Random, T: Array, start: Vector, end: Vector) -> None:
    """Add a cable that hangs and wanders between two points."""
    a, b = np.array(start), np.array(end)
    steps = np.linspace(0, 1, 7)[:, None]
    wander = rng.uniform(-0.05, 0.05, (7, 3)) * np.sin(np.pi * steps)
    line = a + (b - a) * steps + wander
    line[:, 2] = np.maximum(line[:, 2] - 0.1 * np.sin(np.pi * steps[:, 0]), 0.008)
    rubber = plain(rng, one_of(rng, ((30, 30, 32), (190, 40, 40), (210, 190, 60))), 0.02)
    scene.tube(T, line, 0.006, Material(rubber), 4)
