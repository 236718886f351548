"""A working place: table, monitors, keyboard, papers, mug, lamp, chair. Each stands on z = 0, looking along -y."""

import numpy as np

from sensors.arena import paint, prints, wares
from sensors.arena.furniture import CLOTHS, WOODS, Random, cable, one_of, papers, pile
from sensors.arena.scene import BLACK, GLASS, Array, Builder, pose
from sensors.arena.texture import Image


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
        T,
        (0, -0.0205, 0.135 + height / 2),
        inner,
        (0, 0, -height + 0.04),
        prints.screen(rng),
        infrared=GLASS,
        glow=0.75,
    )
    scene.box(T, (0, 0.03, 0.08), (0.06, 0.025, 0.16), black, infrared=BLACK)
    scene.box(T, (0, 0.01, 0.006), (0.24, 0.18, 0.012), black, infrared=BLACK)


def mug(scene: Builder, rng: Random, T: Array) -> None:
    """Add a mug with coffee."""
    glaze = paint.plain(rng, paint.some_color(rng), 0.004)
    scene.drum(T, (0, 0, 0), 0.042, 0.095, glaze, 12, paint.plain(rng, (52, 32, 22), 0.01))
    scene.tube(T, [(0.04, 0, 0.075), (0.072, 0, 0.068), (0.072, 0, 0.032), (0.04, 0, 0.022)], 0.007, glaze, 4)


def lamp(scene: Builder, rng: Random, T: Array) -> None:
    """Add a desk lamp."""
    metal = paint.plain(rng, one_of(rng, ((190, 40, 36), (44, 44, 48), (210, 212, 214))), 0.008)
    scene.drum(T, (0, 0, 0), 0.08, 0.02, metal, 12, metal)
    scene.tube(T, [(0, 0, 0.02), (0.06, 0.05, 0.25), (-0.08, -0.1, 0.42)], 0.009, metal, 5)
    scene.tube(T, [(-0.08, -0.1, 0.43), (-0.12, -0.17, 0.36)], 0.055, metal, 8)


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
        top=wares.keyboard(rng),
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
