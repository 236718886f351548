"""Builds the things and rooms that laboratory.yaml describes; how the file is to be read stands at its head."""

import ast
import operator
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from odom.errors import ConfigError
from odom.geometry.arrays import Array
from sensors.arena import furniture, goods, materials, prints
from sensors.arena.materials import Painter, Random, Texture
from sensors.arena.scene_builder import Material, Scene, pose

FILE = Path(__file__).with_name("laboratory.yaml")
MADE: dict[str, Callable[..., None]] = {
    "cable": furniture.cable,
    "leaves": furniture.leaves,
    "pile of books": furniture.pile_of_books,
    "shelf boards": furniture.shelf_boards,
    "stack of cartons": furniture.stack_of_cartons,
}
"""Things made by functions of the scene, the random numbers, T_world_thing and their measures."""
TEXTURES: dict[str, Texture] = {
    **{name: getattr(goods, name) for name in ("carton", "checkerboard", "drawers", "keyboard", "rack", "window")},
    **{name: getattr(materials, name) for name in ("ceiling", "rug", "white")},
    **{name: getattr(prints, name) for name in ("paper", "picture", "poster", "screen", "whiteboard")},
}
COLORED: dict[str, Callable[..., Painter]] = {"plain": materials.plain, "wood": materials.wood}
PRIMITIVES = ("panel", "box", "tube", "drum", "disc")
PAINTED = ("paint", "image", "top")
"""The measures that are materials."""
_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}

Names = dict[str, Any]


@cache
def things() -> dict[str, Any]:
    """Return the file's things by their names."""
    document: dict[str, Any] = yaml.load(FILE.read_text(), getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    return dict(document["things"])


@cache
def _parsed(text: str) -> ast.expr:
    return ast.parse(text, mode="eval").body


class SceneBuilder:
    """Builds things into `scene`, its random numbers drawn from `rng` in the order of the file.

    Raises ConfigError naming the thing whose description holds an unknown name or lacks a measure.
    """

    def __init__(self, rng: Random) -> None:
        self.scene = Scene()
        self._rng = rng
        self._functions: Names = {
            "uniform": rng.uniform,
            "integers": rng.integers,
            "arange": np.arange,
            "cos": np.cos,
            "sin": np.sin,
        }

    def add(self, name: str, T: Array, **measures: Any) -> None:
        """Add the thing `name` with the given measures at T (T_world_thing)."""
        if name in MADE:
            MADE[name](self.scene, self._rng, T, **measures)
            return
        try:
            thing = things()[name]
            if unknown := thing.keys() - {"measures", "materials", "parts"}:
                raise ValueError(f"unknown: {', '.join(unknown)}")
            names: Names = {"pi": np.pi}
            for key, value in thing.get("measures", {}).items():
                names[key] = measures.pop(key) if key in measures else self._value(value, names)
            if measures:
                raise ValueError(f"unknown measures {', '.join(measures)}")
            for key, value in thing.get("materials", {}).items():
                names[key] = self._material(value, names)
            self._add_parts(thing["parts"], T, names)
        except (KeyError, TypeError, ValueError, SyntaxError) as error:
            raise ConfigError(f"{FILE.name}: {name}: {type(error).__name__}: {error}") from error

    def _add_parts(self, parts: list[dict[str, Any]], T: Array, names: Names) -> None:
        for part in parts:
            ((kind, description),) = part.items()
            if kind == "light":
                self._add_light(description, T, names)
                continue
            for known in self._repeated(list(description.get("for", {}).items()), names):
                own = {key: value for key, value in description.items() if key not in ("for", "place", "parts")}
                here = T @ pose(*self._value(description["place"], known)) if "place" in description else T
                if kind == "group":
                    self._add_parts(description["parts"], here, known)
                    continue
                values = {key: self._measure(key, value, known) for key, value in own.items()}
                if kind in PRIMITIVES:
                    getattr(self.scene, kind)(here, **values)
                else:
                    self.add(kind, here, **values)

    def _add_light(self, description: dict[str, Any], T: Array, names: Names) -> None:
        points = [
            self._value(description["at"], known) for known in self._repeated([*description["for"].items()], names)
        ]
        self.scene.light(T, points, description["towards"], description["power"])

    def _repeated(self, loops: list[tuple[str, Any]], names: Names) -> Iterator[Names]:
        """Yield the names known to a part, once for each combination of the values of its `for`."""
        if not loops:
            yield names
            return
        (variable, values), *inner = loops
        for value in values if isinstance(values, list) else self._value(values, names):
            yield from self._repeated(inner, {**names, variable: self._value(value, names)})

    def _measure(self, key: str, value: Any, names: Names) -> Any:
        if key in PAINTED:
            return self._material(value, names)
        if key == "special":
            return {face: self._material(paint, names) for face, paint in value.items()}
        return value if key == "faces" else self._value(value, names)

    def _material(self, value: Any, names: Names) -> Material:
        """Return the material of a name (of the thing's materials and measures, or of a texture) or a description."""
        if isinstance(value, str):
            return names[value] if value in names else Material(TEXTURES[value](self._rng))
        (kind, what), *options = value.items()
        answers = {key: option for key, option in options if key in ("infrared", "glow")}
        others = {key: option for key, option in options if key not in answers}
        if kind == "texture":
            return Material(TEXTURES[what](self._rng, **others), **answers)
        return Material(COLORED[kind](self._rng, self._color(what, names), **others), **answers)

    def _color(self, value: Any, names: Names) -> materials.Color:
        if isinstance(value, str):
            return materials.some_color(self._rng) if value == "any" else names[value]
        return furniture.one_of(self._rng, value) if isinstance(value[0], list) else value

    def _value(self, value: Any, names: Names) -> Any:
        """Return the number, or list of numbers, that a measure says."""
        if isinstance(value, list):
            return [self._value(one, names) for one in value]
        return self._evaluate(_parsed(value), names) if isinstance(value, str) else value

    def _evaluate(self, node: ast.expr, names: Names) -> Any:
        match node:
            case ast.Constant(value):
                return value
            case ast.Name(name):
                return names[name]
            case ast.UnaryOp(ast.USub(), operand):
                return -self._evaluate(operand, names)
            case ast.BinOp(left, op, right):
                return _OPERATORS[type(op)](self._evaluate(left, names), self._evaluate(right, names))
            case ast.Call(ast.Name(name), arguments):
                return self._functions[name](*[self._evaluate(argument, names) for argument in arguments])
        raise ValueError(f"{ast.unparse(node)!r} is no measure")
