"""The rooms from a seed: the laboratory of the default walk, and a corridor of identical rooms."""

from collections.abc import Iterator, Sequence

import numpy as np

from odom.geometry.arrays import Image
from sensors.arena.array_types import Float32
from sensors.arena.atlas import pack
from sensors.arena.lighting import bake, lit
from sensors.arena.people import People, seats
from sensors.arena.rasteriser import Surfaces
from sensors.arena.renderer import Renderer
from sensors.arena.ring import BAY_M
from sensors.arena.scene_builder import Lamps, Panel, moved
from sensors.arena.scene_file import SceneBuilder

LATER_LIGHT = 0.6
"""Share of their first light that the lamps have on a later visit."""
BAYS = 9
"""Rooms of the corridor: the default walk of 60 s passes six of them."""


def laboratory(seed: int, people: int = 0, is_later: bool = False) -> Renderer:
    """Return the room of the default walk, its middle at the origin, z up, and so many people in it.

    On a later visit four things have moved, and the lamps are dimmer.
    """
    builder = SceneBuilder(np.random.default_rng([seed, 1]))
    builder.add("laboratory", np.eye(4), moved=1.0 if is_later else 0.0)
    scene, lamps = builder.scene, join(builder.scene.lamps)
    if is_later:
        lamps = lamps._replace(power=lamps.power * LATER_LIGHT)
    if not people:
        return draw([scene.panels], bake(scene.panels, [], lamps, seed))
    panels = scene.panels + seats(seed)
    crowd = People.of(seed, people)
    # people are lit as in the middle of the room wherever they are, and cast no shadow
    light = [on_it for one in crowd.in_the_middle() for on_it in bake(one, [], lamps, seed)]
    return draw([panels], bake(panels, [], lamps, seed), crowd, light)


def corridor(seed: int) -> Renderer:
    """Return a row of rooms, open to a corridor along x and identical in every detail; the first one's middle is 0."""
    builder = SceneBuilder(np.random.default_rng([seed, 2]))
    builder.add("bay", np.eye(4), length=BAY_M)
    panels, (light,) = builder.scene.panels, builder.scene.lamps
    shifts = [(k * BAY_M, 0.0, 0.0) for k in (-2, -1, 1, 2)]
    neighbours = [panel for shift in shifts for panel in moved(panels, shift)]
    lamps = join([light, *(Lamps(light.points + shift, light.normals, light.power) for shift in shifts)])
    rooms = [moved(panels, (k * BAY_M, 0.0, 0.0)) for k in range(-1, BAYS - 1)]
    return draw(rooms, bake(panels, neighbours, lamps, seed))


def join(lamps: list[Lamps]) -> Lamps:
    """Return all lamps in one."""
    return Lamps(*(np.concatenate([getattr(lamp, name) for lamp in lamps]) for name in ("points", "normals", "power")))


def draw(
    rooms: list[list[Panel]],
    light: list[Float32],
    people: People | None = None,
    light_on_people: Sequence[Float32] = (),
) -> Renderer:
    """Return what draws rooms that are the first one repeated; `light` (see `bake`) is that of the first's panels."""
    tones: list[float] = []
    moving = list(people.panels) if people else []

    def pictures() -> Iterator[Image]:
        for panel, on_it in zip([*rooms[0], *moving], [*light, *light_on_people], strict=True):
            image = panel.paint()
            tones.append(panel.material.infrared * tone(image))
            yield lit(image, on_it)

    atlas = pack(pictures())
    still = len(rooms[0])
    panels = [*(panel for one in rooms for panel in one), *moving]
    surfaces = Surfaces(
        np.array([p.origin for p in panels]),
        np.array([p.u for p in panels]),
        np.array([p.v for p in panels]),
        np.array([p.material.two_sided for p in panels]),
        np.array([*tones[:still] * len(rooms), *tones[still:]], np.float32),
        np.array([*list(range(still)) * len(rooms), *range(still, still + len(moving))], np.int32),
    )
    return Renderer(surfaces, atlas, people)


def tone(image: Image) -> float:
    """Return how bright a picture is in near infrared: less contrast than to the eye."""
    return 0.35 + 0.65 * float(image.mean()) / 255
