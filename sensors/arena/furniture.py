"""The things of a laboratory. Each stands on z = 0 of its own frame and looks along -y."""

import numpy as np

from sensors.arena import paint, prints, wares
from sensors.arena.paint import Color
from sensors.arena.scene import BLACK, Array, Builder, pose

Random = np.random.Generator

WOODS: tuple[Color, ...] = ((196, 158, 112), (150, 104, 66), (214, 190, 152), (112, 78, 54))
CLOTHS: tuple[Color, ...] = ((40, 66, 120), (150, 46, 42), (52, 104, 74), (196, 138, 44), (86, 84, 92))


def one_of(rng: Random, colors: tuple[Color, ...]) -> Color:
    """Return one of the colours."""
    return colors[int(rng.integers(len(colors)))]


def books(scene: Builder, rng: Random, T: Array, width: float, height: float, depth: float = 0.2) -> None:
    """Add a row of standing books and binders, `height` the room above the shelf."""
    x = -width / 2
    while True:
        thick = float(rng.uniform(0.018, 0.065))
        if x + thick > width / 2:
            return
        if rng.random() < 0.1:
            x += float(rng.uniform(0.04, 0.12))
            continue
        tall = float(rng.uniform(0.6, 0.93)) * height
        deep = float(rng.uniform(0.75, 1.0)) * depth
        cover = wares.spine(rng)
        page = paint.plain(rng, (222, 214, 194), 0.008, 0.05)
        scene.box(
            T,
            (x + thick / 2, depth / 2 - deep / 2, tall / 2),
            (thick - 0.002, deep, tall),
            page,
            "front left right top",
            front=cover,
            left=paint.plain(rng, paint.some_color(rng), 0.01),
            right=paint.plain(rng, paint.some_color(rng), 0.01),
        )
        x += thick


def pile(scene: Builder, rng: Random, T: Array, count: int) -> None:
    """Lying books."""
    z = 0.0
    for _ in range(count):
        w, d, h = float(rng.uniform(0.2, 0.3)), float(rng.uniform(0.15, 0.22)), float(rng.uniform(0.02, 0.05))
        at = T @ pose(0, 0, 0, float(rng.uniform(-25, 25)))
        cover = prints.poster(rng, 0.0025) if rng.random() < 0.5 else paint.plain(rng, paint.some_color(rng))
        spine = wares.spine(rng)
        turned = lambda wm, hm, spine=spine: np.ascontiguousarray(np.rot90(spine(hm, wm)))  # noqa: E731  a painter
        scene.box(at, (0, 0, z + h / 2), (w, d, h - 0.002), paint.plain(rng, (225, 218, 200)), front=turned, top=cover)
        z += h


def shelf(scene: Builder, rng: Random, T: Array, width: float, height: float, depth: float = 0.3) -> None:
    """Add a standing shelf, filled."""
    board = paint.wood(rng, one_of(rng, WOODS), 0.008)
    back = paint.plain(rng, (186, 172, 150), 0.01)
    for x in (-width / 2 + 0.01, width / 2 - 0.01):
        scene.box(T, (x, 0, height / 2), (0.02, depth, height), board)
    scene.panel(T, (0, depth / 2 - 0.01, height / 2), (width, 0, 0), (0, 0, -height), back)
    levels = max(2, round(height / 0.36))
    gap = (height - 0.02) / levels
    for k in range(levels + 1):
        z = k * gap
        scene.box(T, (0, 0, z + 0.01), (width - 0.04, depth, 0.02), board, "front top bottom")
        if k == levels:
            break
        on = T @ pose(0, 0, z + 0.021)
        kind = rng.random()
        if kind < 0.72:
            books(scene, rng, on @ pose(0, 0.02), width - 0.06, gap - 0.04, depth - 0.08)
        else:
            for x in np.arange(-width / 2 + 0.17, width / 2 - 0.12, 0.3):
                size = (float(rng.uniform(0.16, 0.26)), depth - 0.08, float(rng.uniform(0.5, 0.85)) * (gap - 0.04))
                scene.box(on, (float(x), 0, size[2] / 2), size, wares.carton(rng))
    if height < 2.0:
        plant(scene, rng, T @ pose(float(rng.uniform(-width / 4, width / 4)), 0, height + 0.005), 0.3)


def carton_stack(scene: Builder, rng: Random, T: Array, count: int) -> None:
    """Cardboard boxes on each other."""
    z = 0.0
    for _ in range(count):
        size = (float(rng.uniform(0.32, 0.52)), float(rng.uniform(0.3, 0.42)), float(rng.uniform(0.22, 0.38)))
        scene.box(T @ pose(0, 0, 0, float(rng.uniform(-14, 14))), (0, 0, z + size[2] / 2), size, wares.carton(rng))
        z += size[2] + 0.001


def plant(scene: Builder, rng: Random, T: Array, size: float) -> None:
    """Add a pot with pointed leaves."""
    pot = paint.plain(rng, one_of(rng, ((176, 92, 62), (228, 224, 216), (60, 84, 110))), 0.006, 0.05)
    scene.drum(T, (0, 0, 0), 0.28 * size, 0.45 * size, pot, 12, paint.plain(rng, (58, 42, 32), 0.01, 0.2))
    for k in range(34):
        a = k * 2.4 + rng.uniform(-0.3, 0.3)
        rise = rng.uniform(0.15, 1.25)
        length = size * rng.uniform(0.45, 0.95)
        out = np.array([np.cos(a) * np.cos(rise), np.sin(a) * np.cos(rise), np.sin(rise)])
        wide = np.cross(out, (0, 0, 1.0))
        wide *= 0.13 * length / np.linalg.norm(wide)
        root = np.array([0.06 * np.cos(a), 0.06 * np.sin(a), 0.5]) * size
        green: Color = (int(rng.integers(40, 90)), int(rng.integers(105, 160)), int(rng.integers(38, 70)))
        u, v = out * length / 2 + wide, out * length / 2 - wide
        scene.panel(T, tuple(root + out * length / 2), tuple(u), tuple(v), paint.plain(rng, green, 0.008, 0.12), True)


def papers(scene: Builder, rng: Random, T: Array, width: float, depth: float, count: int) -> None:
    """Sheets lying about, each a little higher than the last."""
    for k in range(count):
        at = pose(
            rng.uniform(-width / 2, width / 2),
            rng.uniform(-depth / 2, depth / 2),
            0.003 + 0.0025 * k,
            rng.uniform(-40, 40),
        )
        scene.panel(T @ at, (0, 0, 0), (0.21, 0, 0), (0, -0.297, 0), prints.paper(rng))


def bin_(scene: Builder, rng: Random, T: Array) -> None:
    """Add a waste-paper bin."""
    scene.drum(
        T,
        (0, 0, 0),
        0.14,
        0.34,
        paint.plain(rng, paint.some_color(rng), 0.008),
        14,
        paint.plain(rng, (26, 26, 28), 0.008),
    )
    papers(scene, rng, T @ pose(0, 0, 0.32), 0.04, 0.04, 2)


def cable(
    scene: Builder, rng: Random, T: Array, start: tuple[float, float, float], end: tuple[float, float, float]
) -> None:
    """Add a cable that hangs and wanders between two points."""
    a, b = np.array(start), np.array(end)
    steps = np.linspace(0, 1, 7)[:, None]
    wander = rng.uniform(-0.05, 0.05, (7, 3)) * np.sin(np.pi * steps)
    line = a + (b - a) * steps + wander
    line[:, 2] = np.maximum(line[:, 2] - 0.1 * np.sin(np.pi * steps[:, 0]), 0.008)
    scene.tube(
        T,
        [tuple(p) for p in line],
        0.006,
        paint.plain(rng, one_of(rng, ((30, 30, 32), (190, 40, 40), (210, 190, 60))), 0.02),
        4,
    )


def robot(scene: Builder, rng: Random, T: Array) -> None:
    """Add a wheeled robot with a mast."""
    hull = paint.plain(rng, one_of(rng, ((206, 150, 36), (190, 52, 44), (58, 96, 150))), 0.003)
    black = paint.plain(rng, (32, 32, 34), 0.008, 0.1)
    hub = paint.plain(rng, (170, 172, 176))
    scene.box(
        T,
        (0, 0, 0.2),
        (0.42, 0.5, 0.2),
        hull,
        "front back left right top bottom",
        front=wares.rack(rng),
        left=wares.carton(rng),
        right=wares.rack(rng),
        top=wares.keyboard(rng),
    )
    for x in (-0.23, 0.23):
        for y in (-0.16, 0.16):
            scene.tube(T, [(x - 0.03, y, 0.1), (x + 0.03, y, 0.1)], 0.1, black, 10, BLACK)
            out = 1 if x > 0 else -1
            scene.disc(T, (x + 0.03 * out, y, 0.1), (0, out, 0), (0, 0, -1), 0.098, black)
            scene.disc(T, (x + 0.033 * out, y, 0.1), (0, out, 0), (0, 0, -1), 0.05, hub)
    scene.tube(T, [(0, 0.1, 0.3), (0, 0.1, 0.72)], 0.02, paint.plain(rng, (180, 182, 186)), 6)
    scene.box(T, (0, 0.1, 0.74), (0.28, 0.07, 0.06), black, "front back left right top bottom", front=wares.rack(rng))
    scene.drum(T, (0, -0.12, 0.3), 0.05, 0.08, black, 12, black)
    cable(scene, rng, T, (0.05, 0.1, 0.7), (0.12, -0.1, 0.31))


def instruments(scene: Builder, rng: Random, T: Array, width: float, height: float) -> None:
    """Add a rack of laboratory instruments."""
    side = paint.plain(rng, (74, 76, 82), 0.005)
    scene.box(T, (0, 0, height / 2), (width, 0.55, height), side, front=wares.rack(rng))
    for k in range(4):
        z = 0.3 + 0.32 * k
        scene.box(
            T, (0, -0.29, z), (width * 0.96, 0.05, 0.2), side, "front left right top bottom", front=wares.rack(rng)
        )
    for k in range(3):
        x = float(rng.uniform(-0.2, 0.2))
        cable(scene, rng, T, (x, -0.32, 0.35 + 0.3 * k), (x + float(rng.uniform(-0.15, 0.15)), -0.32, 0.65 + 0.3 * k))
