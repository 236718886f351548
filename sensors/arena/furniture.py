"""The things of a laboratory. Each stands on z = 0 of its own frame and looks along -y."""

import numpy as np

from sensors.arena import paint
from sensors.arena.paint import Color
from sensors.arena.scene import BLACK, GLASS, ORDINARY, Array, Builder, pose
from sensors.arena.texture import Image

Random = np.random.Generator

WOODS: tuple[Color, ...] = ((196, 158, 112), (150, 104, 66), (214, 190, 152), (112, 78, 54))
CLOTHS: tuple[Color, ...] = ((40, 66, 120), (150, 46, 42), (52, 104, 74), (196, 138, 44), (86, 84, 92))


def one_of(rng: Random, colors: tuple[Color, ...]) -> Color:
    """Return one of the colours."""
    return colors[int(rng.integers(len(colors)))]


def table(scene: Builder, rng: Random, T: Array, width: float, depth: float, height: float = 0.73) -> None:
    """Add a table with four legs."""
    top = paint.wood(rng, one_of(rng, WOODS), 0.0032)
    edge = paint.plain(rng, (70, 62, 56))
    scene.box(T, (0, 0, height - 0.015), (width, depth, 0.03), edge, "front back left right top bottom", top=top)
    leg = paint.plain(rng, (120, 122, 126), 0.01)
    for x in (-width / 2 + 0.06, width / 2 - 0.06):
        for y in (-depth / 2 + 0.06, depth / 2 - 0.06):
            scene.box(T, (x, y, (height - 0.03) / 2), (0.05, 0.05, height - 0.03), leg, "front back left right")


def monitor(scene: Builder, rng: Random, T: Array, width: float = 0.53) -> None:
    """Add a monitor on its foot."""
    height = width * 0.58
    black = paint.plain(rng, (28, 28, 31), 0.006)
    scene.box(T, (0, 0, 0.13 + height / 2), (width, 0.035, height), black, "front back left right top bottom", BLACK)
    inner = (width - 0.03, 0.0, 0.0)
    scene.panel(
        T, (0, -0.0205, 0.135 + height / 2), inner, (0, 0, -height + 0.04), paint.screen(rng), infrared=GLASS, glow=0.75
    )
    scene.box(T, (0, 0.03, 0.08), (0.06, 0.025, 0.16), black, infrared=BLACK)
    scene.box(T, (0, 0.01, 0.006), (0.24, 0.18, 0.012), black, infrared=BLACK)


def papers(scene: Builder, rng: Random, T: Array, width: float, depth: float, count: int) -> None:
    """Sheets lying about, each a little higher than the last."""
    for k in range(count):
        at = pose(
            rng.uniform(-width / 2, width / 2),
            rng.uniform(-depth / 2, depth / 2),
            0.003 + 0.0025 * k,
            rng.uniform(-40, 40),
        )
        scene.panel(T @ at, (0, 0, 0), (0.21, 0, 0), (0, -0.297, 0), paint.paper(rng))


def mug(scene: Builder, rng: Random, T: Array) -> None:
    """Add a mug with coffee."""
    glaze = paint.plain(rng, paint.some_color(rng), 0.004)
    scene.drum(T, (0, 0, 0), 0.042, 0.095, glaze, 12, paint.plain(rng, (52, 32, 22), 0.01))
    scene.tube(T, [(0.04, 0, 0.075), (0.072, 0, 0.068), (0.072, 0, 0.032), (0.04, 0, 0.022)], 0.007, glaze, 4)


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
        cover = paint.spine(rng)
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
        cover = paint.poster(rng, 0.0025) if rng.random() < 0.5 else paint.plain(rng, paint.some_color(rng))
        spine = paint.spine(rng)
        turned = lambda wm, hm, spine=spine: np.ascontiguousarray(np.rot90(spine(hm, wm)))  # noqa: E731  a painter
        scene.box(at, (0, 0, z + h / 2), (w, d, h - 0.002), paint.plain(rng, (225, 218, 200)), front=turned, top=cover)
        z += h


def shelf(scene: Builder, rng: Random, T: Array, width: float, height: float, depth: float = 0.3) -> None:
    """Add a standing shelf, filled."""
    board = paint.wood(rng, one_of(rng, WOODS), 0.006)
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
                scene.box(on, (float(x), 0, size[2] / 2), size, paint.carton(rng))
    if height < 2.0:
        plant(scene, rng, T @ pose(float(rng.uniform(-width / 4, width / 4)), 0, height + 0.005), 0.3)


def carton_stack(scene: Builder, rng: Random, T: Array, count: int) -> None:
    """Cardboard boxes on each other."""
    z = 0.0
    for _ in range(count):
        size = (float(rng.uniform(0.32, 0.52)), float(rng.uniform(0.3, 0.42)), float(rng.uniform(0.22, 0.38)))
        scene.box(T @ pose(0, 0, 0, float(rng.uniform(-14, 14))), (0, 0, z + size[2] / 2), size, paint.carton(rng))
        z += size[2] + 0.001


def chair(scene: Builder, rng: Random, T: Array) -> None:
    """Add an office chair on a star of five feet."""
    cloth = paint.plain(rng, one_of(rng, CLOTHS), 0.003, 0.16)
    black = paint.plain(rng, (34, 34, 37), 0.01)
    scene.box(T, (0, 0, 0.47), (0.46, 0.44, 0.07), cloth, "front back left right top bottom")
    scene.box(T, (0, 0.2, 0.82), (0.42, 0.06, 0.46), cloth, "front back left right top bottom")
    scene.tube(T, [(0, 0.23, 0.45), (0, 0.25, 0.62)], 0.025, black, 5, BLACK)
    scene.tube(T, [(0, 0, 0.08), (0, 0, 0.44)], 0.03, black, 6, BLACK)
    for k in range(5):
        a = 2 * np.pi * k / 5 + 0.3
        foot = (0.29 * np.cos(a), 0.29 * np.sin(a), 0.06)
        scene.tube(T, [(0, 0, 0.1), foot], 0.02, black, 4, BLACK)
        scene.drum(T, (foot[0], foot[1], 0.0), 0.025, 0.055, black, 6)
    for x in (-0.25, 0.25):
        scene.tube(T, [(x, 0.08, 0.45), (x, 0.1, 0.66)], 0.014, black, 4, BLACK)
        scene.box(T, (x, 0.0, 0.68), (0.05, 0.26, 0.03), black, "front back left right top bottom", BLACK)


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


def desk(scene: Builder, rng: Random, T: Array, width: float, depth: float = 0.75) -> None:
    """Add a working place: table, monitors, keyboard, papers, mugs, books, lamp, cables, chair."""
    table(scene, rng, T, width, depth)
    on = T @ pose(0, 0, 0.731)
    for x in np.linspace(-width / 4, width / 4, 2 if width > 1.3 else 1) if width > 1.3 else (0.0,):
        monitor(scene, rng, on @ pose(float(x), 0.12, 0, float(rng.uniform(-14, 14))), float(rng.uniform(0.47, 0.58)))
        cable(scene, rng, T, (float(x), 0.2, 0.8), (float(x) + 0.15, 0.36, 0.02))
    scene.box(
        on @ pose(float(rng.uniform(-0.15, 0.05)), -0.18, 0, float(rng.uniform(-8, 8))),
        (0, 0, 0.012),
        (0.44, 0.14, 0.022),
        paint.plain(rng, (42, 43, 46)),
        top=paint.keyboard(rng),
    )
    papers(scene, rng, on, width * 0.75, depth * 0.5, 5)
    mug(scene, rng, on @ pose(width * 0.28, -0.22, 0.02, float(rng.uniform(0, 360))))
    pile(scene, rng, on @ pose(-width / 2 + 0.2, 0.05, 0.02), int(rng.integers(2, 6)))
    lamp(scene, rng, on @ pose(width / 2 - 0.14, 0.2))
    chair(scene, rng, T @ pose(float(rng.uniform(-0.2, 0.2)), -depth / 2 - 0.12, 0, 180 + float(rng.uniform(-35, 35))))
    scene.box(
        T @ pose(width / 2 - 0.25, 0.05),
        (0, 0, 0.26),
        (0.36, 0.5, 0.5),
        paint.plain(rng, (206, 206, 202), 0.005),
        front=drawers(rng),
    )


def drawers(rng: Random) -> paint.Painter:
    """Return a painter of the front of a chest of three drawers."""

    def front(width_m: float, height_m: float) -> Image:
        image = paint.plain(rng, (198, 199, 196), 0.003)(width_m, height_m)
        height, width = image.shape[:2]
        for k in range(3):
            y = k * height // 3
            image[y : y + 2] = 70
            image[y + height // 12 : y + height // 12 + 5, width // 3 : 2 * width // 3] = 60
        return image

    return front


def lamp(scene: Builder, rng: Random, T: Array) -> None:
    """Add a desk lamp."""
    metal = paint.plain(rng, one_of(rng, ((190, 40, 36), (44, 44, 48), (210, 212, 214))), 0.008)
    scene.drum(T, (0, 0, 0), 0.08, 0.02, metal, 12, metal)
    scene.tube(T, [(0, 0, 0.02), (0.06, 0.05, 0.25), (-0.08, -0.1, 0.42)], 0.009, metal, 5)
    scene.tube(T, [(-0.08, -0.1, 0.43), (-0.12, -0.17, 0.36)], 0.055, metal, 8)


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
        front=paint.rack(rng),
        left=paint.carton(rng),
        right=paint.rack(rng),
        top=paint.keyboard(rng),
    )
    for x in (-0.23, 0.23):
        for y in (-0.16, 0.16):
            scene.tube(T, [(x - 0.03, y, 0.1), (x + 0.03, y, 0.1)], 0.1, black, 10, BLACK)
            out = 1 if x > 0 else -1
            scene.disc(T, (x + 0.03 * out, y, 0.1), (0, out, 0), (0, 0, -1), 0.098, black)
            scene.disc(T, (x + 0.033 * out, y, 0.1), (0, out, 0), (0, 0, -1), 0.05, hub)
    scene.tube(T, [(0, 0.1, 0.3), (0, 0.1, 0.72)], 0.02, paint.plain(rng, (180, 182, 186)), 6)
    scene.box(T, (0, 0.1, 0.74), (0.28, 0.07, 0.06), black, "front back left right top bottom", front=paint.rack(rng))
    scene.drum(T, (0, -0.12, 0.3), 0.05, 0.08, black, 12, black)
    cable(scene, rng, T, (0.05, 0.1, 0.7), (0.12, -0.1, 0.31))


def radiator(scene: Builder, rng: Random, T: Array, width: float) -> None:
    """Add a ribbed radiator."""
    white = paint.plain(rng, (226, 226, 222), 0.006)
    for x in np.arange(-width / 2, width / 2, 0.07):
        scene.box(T, (float(x) + 0.025, 0, 0.4), (0.045, 0.08, 0.55), white)


def on_wall(
    scene: Builder,
    rng: Random,
    T: Array,
    width: float,
    height: float,
    painter: paint.Painter,
    rim: Color,
    thick: float = 0.02,
    infrared: float = ORDINARY,
    glow: float = 0.0,
) -> None:
    """Add a framed picture, poster or board: T is at its middle, on the wall, looking into the room along -y."""
    frame = paint.plain(rng, rim, 0.006)
    scene.box(T, (0, -thick / 2, 0), (width, thick, height), frame, "front left right top bottom")
    b = 0.02 if thick > 0.01 else 0.0
    scene.panel(
        T, (0, -thick - 0.002, 0), (width - 2 * b, 0, 0), (0, 0, -height + 2 * b), painter, False, infrared, glow
    )


def window(scene: Builder, rng: Random, T: Array, width: float, height: float) -> None:
    """Add a window with a sill, a cross bar and daylight."""
    on_wall(scene, rng, T, width, height, paint.window(rng), (232, 230, 224), 0.03, GLASS, 1.0)
    bar = paint.plain(rng, (232, 230, 224), 0.006)
    scene.box(T, (0, -0.04, 0), (0.05, 0.03, height), bar, "front left right")
    scene.box(T, (0, -0.045, height * 0.2), (width, 0.02, 0.05), bar, "front top bottom")
    scene.box(T, (0, -0.09, -height / 2 - 0.02), (width + 0.1, 0.18, 0.03), bar, "front left right top bottom")


def instruments(scene: Builder, rng: Random, T: Array, width: float, height: float) -> None:
    """Add a rack of laboratory instruments."""
    side = paint.plain(rng, (74, 76, 82), 0.005)
    scene.box(T, (0, 0, height / 2), (width, 0.55, height), side, front=paint.rack(rng))
    for k in range(4):
        z = 0.3 + 0.32 * k
        scene.box(
            T, (0, -0.29, z), (width * 0.96, 0.05, 0.2), side, "front left right top bottom", front=paint.rack(rng)
        )
    for k in range(3):
        x = float(rng.uniform(-0.2, 0.2))
        cable(scene, rng, T, (x, -0.32, 0.35 + 0.3 * k), (x + float(rng.uniform(-0.15, 0.15)), -0.32, 0.65 + 0.3 * k))


def door(scene: Builder, rng: Random, T: Array) -> None:
    """Add a door with its frame, a notice and a handle."""
    frame = paint.plain(rng, (226, 222, 214), 0.006)
    leaf = paint.wood(rng, one_of(rng, WOODS), 0.003)
    scene.panel(T, (0, -0.012, 1.02), (0.9, 0, 0), (0, 0, -2.04), leaf)
    for x in (-0.49, 0.49):
        scene.box(T, (x, -0.02, 1.06), (0.08, 0.04, 2.12), frame, "front left right")
    scene.box(T, (0, -0.02, 2.08), (1.06, 0.04, 0.08), frame, "front top bottom")
    scene.panel(T, (0, -0.016, 1.55), (0.21, 0, 0), (0, 0, -0.297), paint.paper(rng))
    scene.tube(
        T,
        [(0.36, -0.015, 1.02), (0.36, -0.06, 1.02), (0.26, -0.06, 1.02)],
        0.011,
        paint.plain(rng, (186, 188, 192), 0.01),
        6,
    )
