"""A building from a seed: rooms along a corridor that comes back to where it began, of different and look-alike kinds.

Four rows of rooms, open to the corridor and furnished on its outer side, meet in corners. Each of a few kinds of rooms
is furnished and lit once. Rooms of one kind differ by a picture of their own on the wall, except in one of the four
rows: its rooms are identical, as in `rooms.corridor`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from odom.geometry.arrays import Array, Image
from sensors.arena.array_types import Float32, Light
from sensors.arena.atlas import Atlas, pack
from sensors.arena.lighting import bake, lit
from sensors.arena.prints import poster
from sensors.arena.rasteriser import Surfaces
from sensors.arena.renderer import Moments, Renderer
from sensors.arena.ring import BAY_M, ROWS, WIDTH_M, T_world_row, side_m
from sensors.arena.rooms import LATER_LIGHT, join, tone
from sensors.arena.scene_builder import Lamps, Material, Panel, moved, pose
from sensors.arena.scene_file import SceneBuilder

ALIKE_ROW = 2
"""The row whose rooms are alike."""
ROOMS_OF_A_KIND = 4
"""About so many rooms share their furniture: more make it quicker to furnish, and places harder to tell apart."""
NEAR = 4
"""Rooms and corners each way along the corridor that are drawn: farther ones are hidden behind walls or pillars."""
PICTURE = pose(0.1, WIDTH_M / 2, 1.72)
"""Where a room's own picture hangs."""


@dataclass(frozen=True, eq=False)
class _Kind:
    """The panels of a kind of room or corner around its own middle, the light on them, and their textures' numbers.

    The last `own` panels are those of the picture that each room has for itself.
    """

    panels: list[Panel]
    light: list[Float32]
    first: int
    own: int


@dataclass(frozen=True, eq=False)
class Building:
    """What draws the building: at each place of it, the `sections` (rooms and corners, in a ring) around the camera."""

    sections: tuple[Surfaces, ...]
    middles: Array
    atlas: Atlas

    def near(self, T_world_camera: Array) -> Renderer:
        """Return what draws the surroundings of a camera."""
        away = np.linalg.norm(self.middles - T_world_camera[:2, 3], axis=1)
        return _around(self, int(np.argmin(away)))

    def color(self, T_camera_world: Array, K: Array, shape: tuple[int, int], moments: Moments) -> tuple[Light, Float32]:
        """See `Renderer.color`."""
        return self.near(np.linalg.inv(T_camera_world[0])).color(T_camera_world, K, shape, moments)


@lru_cache(maxsize=2 * NEAR + 2)
def _around(building: Building, section: int) -> Renderer:
    count = len(building.sections)
    near = dict.fromkeys((section + k) % count for k in range(-NEAR, NEAR + 1))
    shown = [building.sections[k] for k in near]
    return Renderer(Surfaces(*(np.concatenate(parts) for parts in zip(*shown, strict=True))), building.atlas)


def building(seed: int, rooms: int, is_later: bool = False) -> Building:
    """Return the building with so many rooms, a multiple of four; its first row begins at the origin, along x.

    On a later visit four things in each other kind of room have moved, and the lamps are dimmer.
    """
    images: list[tuple[Panel, Float32]] = []
    kinds = [_room(seed, k, is_later, images) for k in range(1 + rooms // ROOMS_OF_A_KIND)]
    corners = [_corner(seed, k, is_later, images) for k in range(ROWS)]
    order = np.random.default_rng([seed, 6]).integers(1, len(kinds), rooms)
    placed: list[tuple[_Kind, Array, int]] = []
    for row in range(ROWS):
        T = T_world_row(rooms, row)
        for k in range(rooms // ROWS):
            number = row * (rooms // ROWS) + k
            kind = kinds[0 if row == ALIKE_ROW else int(order[number])]
            T_room = T @ pose((k + 0.5) * BAY_M, 0.0)
            own = kind.first + len(kind.panels) - kind.own if row == ALIKE_ROW else len(images)
            if row != ALIKE_ROW:
                pictures = _picture(np.random.default_rng([seed, 5, number]))
                images += zip(pictures, kind.light[-kind.own :], strict=True)
            placed.append((kind, T_room, own))
        corner = corners[row]
        placed.append((corner, T @ pose(side_m(rooms) + WIDTH_M / 2, 0.0), corner.first + len(corner.panels)))
    tones: list[float] = []
    atlas = pack(_painted(images, tones))
    sections = tuple(_surfaces(kind, T, own, tones) for kind, T, own in placed)
    return Building(sections, np.array([T[:2, 3] for _, T, _ in placed]), atlas)


def _room(seed: int, kind: int, is_later: bool, images: list[tuple[Panel, Float32]]) -> _Kind:
    """Furnish and light a kind of room; its pictures are added to `images`."""
    builder = SceneBuilder(np.random.default_rng([seed, 4, kind]))
    builder.add("bay", np.eye(4), length=BAY_M, moved=float(is_later and kind % 2 == 1))
    own = _picture(np.random.default_rng([seed, 5, 1_000_000 + kind]))
    shifts = [(k * BAY_M, 0.0, 0.0) for k in (-2, -1, 1, 2)]
    neighbours = [panel for shift in shifts for panel in moved(builder.scene.panels, shift)]
    light = builder.scene.lamps[0]
    lamps = join([light, *(light._replace(points=light.points + shift) for shift in shifts)])
    return _lit_kind([*builder.scene.panels, *own], len(own), neighbours, lamps, seed, is_later, images)


def _corner(seed: int, kind: int, is_later: bool, images: list[tuple[Panel, Float32]]) -> _Kind:
    """Furnish and light a corner."""
    builder = SceneBuilder(np.random.default_rng([seed, 8, kind]))
    builder.add("corner", np.eye(4))
    return _lit_kind(builder.scene.panels, 0, [], join(builder.scene.lamps), seed, is_later, images)


def _lit_kind(
    panels: list[Panel],
    own: int,
    neighbours: list[Panel],
    lamps: Lamps,
    seed: int,
    is_later: bool,
    images: list[tuple[Panel, Float32]],
) -> _Kind:
    lamps = lamps._replace(power=lamps.power * (LATER_LIGHT if is_later else 1.0))
    light = bake(panels, neighbours, lamps, seed)
    kind = _Kind(panels, light, len(images), own)
    images += zip(panels, light, strict=True)
    return kind


def _picture(rng: np.random.Generator) -> list[Panel]:
    """Return the panels of a framed picture that hangs where each room has its own."""
    builder = SceneBuilder(rng)
    rim = [int(value) for value in rng.integers(30, 200, 3)]
    builder.add("framed", PICTURE, width=0.36, height=0.5, image=Material(poster(rng)), rim=rim)
    return builder.scene.panels


def _painted(images: Sequence[tuple[Panel, Float32]], tones: list[float]) -> Iterator[Image]:
    """Yield the pictures under their light; what each sends back of near infrared light is added to `tones`."""
    for panel, light in images:
        image = panel.paint()
        tones.append(panel.material.infrared * tone(image))
        yield lit(image, light)


def _surfaces(kind: _Kind, T_world_section: Array, own: int, tones: Sequence[float]) -> Surfaces:
    """Return the surfaces of a room or corner in the world; its own picture's textures begin with number `own`."""
    R, t = T_world_section[:3, :3], T_world_section[:3, 3]
    panels = [replace(p, origin=R @ p.origin + t, u=R @ p.u, v=R @ p.v) for p in kind.panels]
    shared = len(panels) - kind.own
    patch = np.array([*range(kind.first, kind.first + shared), *range(own, own + kind.own)], np.int32)
    return Surfaces(
        np.array([p.origin for p in panels]),
        np.array([p.u for p in panels]),
        np.array([p.v for p in panels]),
        np.array([p.material.two_sided for p in panels]),
        np.array([tones[k] for k in patch], np.float32),
        patch,
    )
