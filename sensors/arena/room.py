"""Furnished rooms from a seed: the laboratory of the default walk, and a corridor of identical rooms."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sensors.arena import fittings, furniture, paint, prints, wares, workplace
from sensors.arena.light import Lamps, bake, lit
from sensors.arena.paint import Color
from sensors.arena.render import Renderer, Surfaces
from sensors.arena.scene import Array, Builder, Panel, moved, pose
from sensors.arena.texture import pack

WALL_TONES: tuple[Color, ...] = ((226, 222, 210), (206, 214, 216), (222, 212, 196), (212, 218, 204))
ACCENTS: tuple[Color, ...] = ((96, 128, 142), (168, 108, 84), (116, 132, 96), (150, 134, 160))


def shell(scene: Builder, rng: np.random.Generator, size: tuple[float, float, float]) -> None:
    """Floor, ceiling and four walls of a room centred at the origin, with skirting boards."""
    a, b, h = size[0] / 2, size[1] / 2, size[2]
    tone = furniture.one_of(rng, WALL_TONES)
    accent = furniture.one_of(rng, ACCENTS)
    T = np.eye(4)
    floor = paint.wood(rng, furniture.one_of(rng, ((176, 130, 88), (150, 112, 80), (190, 160, 122))), 0.0055, 0.11)
    scene.panel(T, (0, 0, 0), (size[0], 0, 0), (0, -size[1], 0), floor)
    scene.panel(T, (0, 0, h), (size[0], 0, 0), (0, size[1], 0), paint.ceiling(rng))
    walls = ((0, b, 0.0, size[0]), (a, 0, -90.0, size[1]), (0, -b, 180.0, size[0]), (-a, 0, 90.0, size[1]))
    skirting = paint.plain(rng, (236, 234, 228), 0.006)
    for k, (x, y, yaw, width) in enumerate(walls):
        wall = pose(x, y, 0, yaw)
        color = accent if k == 1 else tone
        scene.panel(wall, (0, 0, h / 2), (width, 0, 0), (0, 0, -h), paint.plain(rng, color, 0.01, 0.022))
        scene.box(wall, (0, -0.008, 0.04), (width, 0.016, 0.08), skirting, "front top")


def ceiling_lamps(scene: Builder, spots: list[tuple[float, float]], height: float) -> tuple[Array, Array, Array]:
    """Add ceiling panels at `spots` and return their light."""
    points, power = [], []
    for x, y in spots:
        scene.panel(
            np.eye(4),
            (x, y, height - 0.01),
            (0.6, 0, 0),
            (0, 1.2, 0),
            lambda w, h: np.full((8, 8, 3), 255, np.uint8),
            glow=9.0,
        )
        for dx in (-0.18, 0.18):
            for dy in (-0.4, 0.0, 0.4):
                points.append((x + dx, y + dy, height - 0.02))
                power.append((0.4, 0.383, 0.345))
    return np.array(points), np.tile((0.0, 0.0, -1.0), (len(points), 1)), np.array(power)


def daylight(T_world_window: Array, width: float, height: float) -> tuple[Array, Array, Array]:
    """Return the light that a window lets in."""
    points = np.array([(x * width, -0.05, z * height) for x in (-0.33, 0, 0.33) for z in (-0.3, 0.0, 0.3)])
    world = points @ T_world_window[:3, :3].T + T_world_window[:3, 3]
    normal = T_world_window[:3, :3] @ np.array([0.0, -1.0, 0.0])
    return world, np.tile(normal, (9, 1)), np.tile((0.20, 0.225, 0.26), (9, 1))


def laboratory(seed: int) -> Renderer:
    """Return the room of the default walk, 6.6 x 5.4 x 2.7 m, its middle at the origin, z up."""
    rng = np.random.default_rng([seed, 1])
    scene = Builder()
    size = (6.6, 5.4, 2.7)
    a, b = size[0] / 2, size[1] / 2
    shell(scene, rng, size)
    rug = (2.3, 1.6)
    scene.panel(pose(0, 0, 0.004), (0, 0, 0), (rug[0], 0, 0), (0, -rug[1], 0), paint.rug(rng))

    north, east = pose(0, b), pose(a, 0, 0, -90)
    south, west = pose(0, -b, 0, 180), pose(-a, 0, 0, 90)

    workplace.desk(scene, rng, north @ pose(-1.5, -0.42), 1.7)
    workplace.desk(scene, rng, north @ pose(0.6, -0.42), 1.5)
    furniture.shelf(scene, rng, north @ pose(2.55, -0.17), 1.1, 2.05)
    fittings.on_wall(scene, rng, north @ pose(-1.9, 0, 1.75), 0.9, 0.64, prints.poster(rng), (40, 42, 46))
    fittings.on_wall(scene, rng, north @ pose(-0.75, 0, 1.7), 0.6, 0.8, prints.picture(rng), (92, 64, 44))
    fittings.on_wall(scene, rng, north @ pose(0.55, 0, 1.72), 1.1, 0.75, prints.poster(rng), (230, 230, 226), 0.006)
    fittings.on_wall(scene, rng, north @ pose(1.55, 0, 1.75), 0.5, 0.7, prints.picture(rng), (30, 30, 32))

    light = east @ pose(0.2, 0, 1.62)
    fittings.window(scene, rng, light, 1.7, 1.25)
    fittings.radiator(scene, rng, east @ pose(0.2, -0.07), 1.5)
    furniture.carton_stack(scene, rng, east @ pose(-1.55, -0.3), 3)
    furniture.plant(scene, rng, east @ pose(1.4, -0.35), 0.75)
    fittings.on_wall(scene, rng, east @ pose(-1.5, 0, 1.75), 0.62, 0.88, prints.poster(rng), (40, 42, 46))
    fittings.on_wall(scene, rng, east @ pose(1.75, 0, 1.7), 0.5, 0.66, prints.picture(rng), (120, 92, 56))

    furniture.shelf(scene, rng, south @ pose(-2.3, -0.17), 1.4, 1.5)
    workplace.desk(scene, rng, south @ pose(-0.35, -0.42), 1.6)
    fittings.on_wall(scene, rng, south @ pose(0.0, 0, 1.65), 1.9, 1.0, prints.whiteboard(rng), (176, 180, 184))
    fittings.on_wall(scene, rng, south @ pose(-1.55, 0, 1.95), 0.7, 0.5, prints.picture(rng), (60, 44, 34))
    furniture.carton_stack(scene, rng, south @ pose(1.15, -0.32), 2)
    furniture.instruments(scene, rng, south @ pose(2.1, -0.34), 0.62, 1.75)
    furniture.bin_(scene, rng, south @ pose(1.6, -0.4))

    fittings.door(scene, rng, west @ pose(-1.55, 0))
    furniture.shelf(scene, rng, west @ pose(0.15, -0.17), 1.2, 1.85)
    workplace.desk(scene, rng, west @ pose(1.65, -0.42), 1.3)
    fittings.on_wall(scene, rng, west @ pose(1.55, 0, 1.72), 1.0, 0.7, prints.poster(rng), (40, 42, 46))
    fittings.on_wall(scene, rng, west @ pose(-0.72, 0, 1.6), 0.4, 0.56, prints.picture(rng), (36, 36, 40))

    for x in (-1.22, 1.22):
        island = pose(x, float(rng.uniform(-0.05, 0.05)), 0, float(rng.uniform(-25, 25)))
        workplace.table(scene, rng, island, 0.75, 0.5, 0.7)
        furniture.papers(scene, rng, island @ pose(0, 0, 0.701), 0.4, 0.2, 3)
        if x < 0:
            furniture.robot(scene, rng, island @ pose(0, 0, 0.71, 40))
        else:
            board = island @ pose(-0.1, 0.1, 0.712, 20)
            scene.box(
                board,
                (0, 0, 0.17),
                (0.42, 0.015, 0.34),
                paint.plain(rng, (210, 206, 200)),
                front=wares.checker(),
                back=wares.checker(),
            )
            furniture.carton_stack(scene, rng, island @ pose(0.2, -0.02, 0.712, 30), 1)
            workplace.mug(scene, rng, island @ pose(-0.25, -0.15, 0.715))
        furniture.carton_stack(scene, rng, island @ pose(0.05, 0.0, 0.002, 15), 1)
    lamps = [
        ceiling_lamps(scene, [(-1.7, -1.1), (-1.7, 1.1), (1.7, -1.1), (1.7, 1.1)], size[2]),
        daylight(light, 1.7, 1.25),
    ]
    return draw([scene.panels], bake(scene.panels, [], join_lamps(lamps), seed))


BAY_M = 3.2
"""Length of one of the corridor's rooms."""
BAYS = 9


def corridor(seed: int) -> Renderer:
    """Return a row of rooms, open to a corridor along x and identical to the last book; the first one's middle is 0."""
    rng = np.random.default_rng([seed, 2])
    scene = Builder()
    width, depth, h = BAY_M, 3.6, 2.7
    T = np.eye(4)
    tone = furniture.one_of(rng, WALL_TONES)
    wall = paint.plain(rng, tone, 0.01, 0.022)
    scene.panel(T, (0, 0, 0), (width, 0, 0), (0, -depth, 0), paint.wood(rng, (176, 130, 88), 0.0055, 0.11))
    scene.panel(T, (0, 0, h), (width, 0, 0), (0, depth, 0), paint.ceiling(rng))
    north, south = pose(0, depth / 2), pose(0, -depth / 2, 0, 180)
    for side in (north, south):
        scene.panel(side, (0, 0, h / 2), (width, 0, 0), (0, 0, -h), wall)
        scene.box(side, (0, -0.008, 0.04), (width, 0.016, 0.08), paint.plain(rng, (236, 234, 228), 0.006), "front top")
    scene.box(
        T,
        (-width / 2 + 0.06, depth / 2 - 0.45, h / 2),
        (0.12, 0.9, h),
        paint.plain(rng, furniture.one_of(rng, ACCENTS), 0.004),
        "front left right",
    )
    workplace.desk(scene, rng, north @ pose(-0.55, -0.42), 1.4)
    furniture.shelf(scene, rng, north @ pose(0.85, -0.17), 1.0, 1.9)
    fittings.on_wall(scene, rng, north @ pose(-0.65, 0, 1.75), 0.95, 0.66, prints.poster(rng), (40, 42, 46))
    furniture.plant(scene, rng, north @ pose(1.4, -0.3), 0.5)
    furniture.carton_stack(scene, rng, north @ pose(0.35, -0.5), 2)
    fittings.door(scene, rng, south)
    light = ceiling_lamps(scene, [(0.0, 0.2)], h)
    shifts = [(k * width, 0.0, 0.0) for k in (-2, -1, 1, 2)]
    neighbours = [panel for shift in shifts for panel in moved(scene.panels, shift)]
    lamps = join_lamps([light, *((light[0] + shift, light[1], light[2]) for shift in shifts)])
    rooms = [moved(scene.panels, (k * width, 0.0, 0.0)) for k in range(-1, BAYS - 1)]
    return draw(rooms, bake(scene.panels, neighbours, lamps, seed))


def join_lamps(lamps: list[tuple[Array, Array, Array]]) -> Lamps:
    """Return all lamps in one."""
    points, normals, power = zip(*lamps, strict=True)
    return Lamps(np.concatenate(points), np.concatenate(normals), np.concatenate(power))


def draw(rooms: list[list[Panel]], light: list[NDArray[np.float32]]) -> Renderer:
    """Return what draws rooms that are the first one repeated; `light` (see `bake`) is that of the first's panels."""
    tones: list[float] = []

    def pictures() -> Iterator[NDArray[np.uint8]]:
        for panel, on_it in zip(rooms[0], light, strict=True):
            image = panel.paint()
            tones.append(panel.infrared * _tone(image))
            yield lit(image, on_it)

    atlas = pack(pictures())
    panels = [panel for one in rooms for panel in one]
    surfaces = Surfaces(
        np.array([p.origin for p in panels]),
        np.array([p.u for p in panels]),
        np.array([p.v for p in panels]),
        np.array([p.two_sided for p in panels]),
        np.tile(np.array(tones, np.float32), len(rooms)),
        np.tile(np.arange(len(rooms[0]), dtype=np.int32), len(rooms)),
    )
    return Renderer(surfaces, atlas)


def _tone(image: NDArray[np.uint8]) -> float:
    """Return how bright a picture is in near infrared: less contrast than to the eye."""
    return 0.35 + 0.65 * float(image.mean()) / 255
