"""People in a room: moving surfaces, each fixed to a bone of a body."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from odom.geometry.arrays import Array, Image, Index, Mask
from sensors.arena import clothes
from sensors.arena.clothes import cloth
from sensors.arena.figure import AT_REST, Bone, bones, held
from sensors.arena.materials import Random, some_color
from sensors.arena.scene_builder import ORDINARY, Material, Panel, Scene
from sensors.arena.scene_file import SceneBuilder
from sensors.arena.walkers import carton_place, document, walker

MOST_PEOPLE = 4
"""How many parts people.yaml has."""
CARTON = "carton to carry"
"""The thing that is carried."""
CARTON_DEPTH_M = 0.26
"""How deep it is, metres."""
SKIN_INFRARED = 0.5
"""Share of near infrared light that skin sends back."""


class Placed(NamedTuple):
    """Where m moving surfaces are at an instant: world frame, metres (m x 3 each)."""

    origin: Array
    u: Array
    v: Array


@dataclass(frozen=True, eq=False)
class People:
    """`panels` are the surfaces in the frames of their bones; `bone` numbers these: 13 a person, then the carton's."""

    heights_m: tuple[float, ...]
    panels: tuple[Panel, ...]
    bone: Index

    @classmethod
    def of(cls, seed: int, count: int) -> "People":
        """Return the first `count` people of people.yaml, dressed by the seed."""
        heights, panels, bone = [], [], []
        for number in range(count):
            rng = np.random.default_rng([seed, 21, number])
            heights.append(float(rng.uniform(1.6, 1.88)))
            for index, part in enumerate(_body(rng, heights[-1], number)):
                panels += part
                bone += [len(Bone) * number + index] * len(part)
        builder = SceneBuilder(np.random.default_rng([seed, 21, MOST_PEOPLE]))
        builder.add(CARTON, np.eye(4), depth=CARTON_DEPTH_M)
        panels += builder.scene.panels
        bone += [len(Bone) * count] * len(builder.scene.panels)
        return cls(tuple(heights), tuple(panels), np.array(bone))

    def in_the_middle(self) -> Iterator[list[Panel]]:
        """Yield each person's panels, standing upright in the middle of the room, and the carton's at its place."""
        for number, height in enumerate(self.heights_m):
            yield self._placed_panels(bones(height, AT_REST), len(Bone) * number)
        place, _ = self._carton(0.0)
        yield self._placed_panels(place[None], len(Bone) * len(self.heights_m))

    def at(self, t: float) -> Placed:
        """Return where all surfaces are at `t` seconds."""
        T = np.concatenate([*self._bones(t), self._carton(t)[0][None]])[self.bone]
        R = T[:, :3, :3]
        origin, u, v = (np.einsum("nij,nj->ni", R, each) for each in self._in_bones)
        return Placed(origin + T[:, :3, 3], u, v)

    def moving(self, t: float) -> Mask:
        """Return which surfaces are a person's, or the carton's while it is off its places."""
        return (self.bone < len(Bone) * len(self.heights_m)) | self._carton(t)[1]

    @cached_property
    def _in_bones(self) -> Placed:
        return Placed(*(np.array([getattr(panel, name) for panel in self.panels]) for name in Placed._fields))

    def _bones(self, t: float) -> list[Array]:
        return [bones(height, walker(k, height).posture(t)) for k, height in enumerate(self.heights_m)]

    def _carton(self, t: float) -> tuple[Array, bool]:
        for number, height in enumerate(self.heights_m):
            walks = walker(number, height)
            if walks.carries:
                arms = held(bones(height, walks.posture(t)), height, CARTON_DEPTH_M)
                return carton_place(walks, arms, t)
        return carton_place(replace(walker(0, self.heights_m[0]), carries=()), np.eye(4), 0.0)

    def _placed_panels(self, T_world_bone: Array, first: int) -> list[Panel]:
        out = []
        for panel, bone in zip(self.panels, self.bone, strict=True):
            if first <= bone < first + len(T_world_bone):
                T = T_world_bone[bone - first]
                R = T[:3, :3]
                out.append(Panel(R @ panel.origin + T[:3, 3], R @ panel.u, R @ panel.v, panel.material))
        return out


def _prism(size: tuple[float, float], span: tuple[float, float], image: Image, sides: int, skin: bool = False) -> Scene:
    """Return an upright prism: half widths `size` (x, y), from `span[0]` up to `span[1]`, closed on top; metres."""
    scene, infrared = Scene(), SKIN_INFRARED if skin else ORDINARY
    turns = 2 * np.pi * np.arange(sides + 1) / sides
    ring = np.column_stack([size[0] * np.cos(turns), size[1] * np.sin(turns), np.zeros(sides + 1)])
    middle = np.array([0.0, 0.0, (span[0] + span[1]) / 2])
    for k in range(sides):
        material = Material(clothes.around(image, k, sides), infrared)
        scene.panel(
            np.eye(4), middle + (ring[k] + ring[k + 1]) / 2, ring[k + 1] - ring[k], (0, 0, span[0] - span[1]), material
        )
    for share, half in ((0.0, 0.6), (0.75, 0.2), (-0.75, 0.2)):
        across = 2 * size[0] * np.sqrt(1 - (abs(share) + (half if share else 0.0)) ** 2 + 1e-9) * 0.98
        lid = Material(clothes.around(image[: max(2, len(image) // 8)], 0, sides), infrared)
        scene.panel(np.eye(4), (0, share * size[1], span[1]), (across, 0, 0), (0, -2 * half * size[1], 0), lid)
    return scene


def _body(rng: Random, height_m: float, number: int) -> list[list[Panel]]:
    """Return the panels of each bone, in its frame."""
    h = height_m
    skin, hair = (kinds[int(rng.integers(len(kinds)))] for kinds in (clothes.SKINS, clothes.HAIRS))
    shirt, legs = some_color(rng), tuple(int(c) for c in rng.uniform(0.3, 0.8) * np.array([90, 100, 130]))
    printed = clothes.PRINTS[number % len(clothes.PRINTS)]
    trousers = (legs[0], legs[1], legs[2])
    short = bool(rng.random() < 0.5)

    def girth(size: tuple[float, float]) -> float:
        return np.pi * (size[0] + size[1]) * h

    def part(size: tuple[float, float], span: tuple[float, float], image: Image, sides: int, bare: bool) -> list[Panel]:
        return _prism((size[0] * h, size[1] * h), (span[0] * h, span[1] * h), image, sides, bare).panels

    def sleeve(size: float, span: tuple[float, float], bare: bool) -> list[Panel]:
        tall = (span[1] - span[0]) * h
        image = cloth(rng, girth((size, size)), tall, skin if bare else shirt, None if bare else _plainer(printed))
        return part((size, size), span, image, 6, bare)

    def leg(size: float, span: tuple[float, float]) -> list[Panel]:
        image = cloth(rng, girth((size, size)), (span[1] - span[0]) * h, trousers)
        return part((size, size * 1.1), span, image, 6, False)

    chest, belly, skull = (0.108, 0.066), (0.096, 0.066), (0.044, 0.056)
    torso = part(chest, (0.0, 0.262), cloth(rng, girth(chest), 0.262 * h, shirt, printed), 12, False)
    pelvis = part(belly, (-0.055, 0.055), cloth(rng, girth(belly), 0.11 * h, trousers), 10, False)
    head = part(skull, (0.018, 0.136), clothes.face(rng, girth(skull), 0.118 * h, skin, hair), 10, True)
    head += part((0.03, 0.03), (-0.01, 0.03), cloth(rng, girth((0.03, 0.03)), 0.04 * h, skin), 6, True)
    shoe = Scene()
    shoe.box(np.eye(4), (0, -0.035 * h, -0.02 * h), (0.055 * h, 0.15 * h, 0.038 * h), _leather(rng))
    arms, limbs = [], []
    for _ in range(2):
        hand = part((0.018, 0.026), (-0.235, -0.14), cloth(rng, 0.14 * h, 0.095 * h, skin), 5, True)
        arms += [sleeve(0.03, (-0.178, 0.022), False), sleeve(0.024, (-0.146, 0.008), short) + hand]
        limbs += [leg(0.05, (-0.25, 0.03)), leg(0.036, (-0.245, 0.012)), shoe.panels]
    return [pelvis, torso, head, *arms, *limbs]


def _plainer(printed: clothes.Draw) -> clothes.Draw | None:
    """Return what of a shirt's print is on its sleeves: pictures are not."""
    return None if printed is clothes.pictures else printed


def _leather(rng: Random) -> Material:
    tone = int(rng.integers(25, 90))
    image = cloth(rng, 0.3, 0.1, (tone, tone - 6, tone - 12))
    return Material(lambda width_m, height_m: image)


def seats(seed: int) -> list[Panel]:
    """Return the furniture that people use, where it stands in the room."""
    builder = SceneBuilder(np.random.default_rng([seed, 22]))
    for name, *place in document()["furniture"]:
        x, y, height = place
        T = np.eye(4)
        T[:2, 3] = x, y
        builder.add(name, T, height=height)
    return builder.scene.panels
