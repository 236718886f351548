"""What is fitted to walls: pictures, boards, windows, doors, radiators. Each looks along -y of its own frame."""

import numpy as np

from sensors.arena import paint, prints, wares
from sensors.arena.furniture import WOODS, Random, one_of
from sensors.arena.paint import Color
from sensors.arena.scene import GLASS, ORDINARY, Array, Builder


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
    on_wall(scene, rng, T, width, height, wares.window(rng), (232, 230, 224), 0.03, GLASS, 1.0)
    bar = paint.plain(rng, (232, 230, 224), 0.006)
    scene.box(T, (0, -0.04, 0), (0.05, 0.03, height), bar, "front left right")
    scene.box(T, (0, -0.045, height * 0.2), (width, 0.02, 0.05), bar, "front top bottom")
    scene.box(T, (0, -0.09, -height / 2 - 0.02), (width + 0.1, 0.18, 0.03), bar, "front left right top bottom")


def door(scene: Builder, rng: Random, T: Array) -> None:
    """Add a door with its frame, a notice and a handle."""
    frame = paint.plain(rng, (226, 222, 214), 0.006)
    leaf = paint.wood(rng, one_of(rng, WOODS), 0.003)
    scene.panel(T, (0, -0.012, 1.02), (0.9, 0, 0), (0, 0, -2.04), leaf)
    for x in (-0.49, 0.49):
        scene.box(T, (x, -0.02, 1.06), (0.08, 0.04, 2.12), frame, "front left right")
    scene.box(T, (0, -0.02, 2.08), (1.06, 0.04, 0.08), frame, "front top bottom")
    scene.panel(T, (0, -0.016, 1.55), (0.21, 0, 0), (0, 0, -0.297), prints.paper(rng))
    scene.tube(
        T,
        [(0.36, -0.015, 1.02), (0.36, -0.06, 1.02), (0.26, -0.06, 1.02)],
        0.011,
        paint.plain(rng, (186, 188, 192), 0.01),
        6,
    )


def radiator(scene: Builder, rng: Random, T: Array, width: float) -> None:
    """Add a ribbed radiator."""
    white = paint.plain(rng, (226, 226, 222), 0.006)
    for x in np.arange(-width / 2, width / 2, 0.07):
        scene.box(T, (float(x) + 0.025, 0, 0.4), (0.045, 0.08, 0.55), white)
