"""The file that describes the rooms, and the scenes built from it."""

from typing import Any

import numpy as np
import pytest

from odom.errors import ConfigError
from sensors.arena import scene_file
from sensors.arena.scene_builder import Scene
from sensors.arena.scene_file import SceneBuilder, things


def built(thing: dict[str, Any], monkeypatch: pytest.MonkeyPatch, **measures: Any) -> Scene:
    monkeypatch.setattr(scene_file, "things", lambda: {"thing": thing})
    builder = SceneBuilder(np.random.default_rng(1))
    builder.add("thing", np.eye(4), **measures)
    return builder.scene


def test_the_rooms_use_every_thing_of_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    used: set[str] = set()
    add = SceneBuilder.add
    monkeypatch.setattr(SceneBuilder, "add", lambda self, name, T, **m: (used.add(name), add(self, name, T, **m)))
    builder = SceneBuilder(np.random.default_rng(1))
    builder.add("laboratory", np.eye(4))
    builder.add("bay", np.eye(4), length=3.2)
    builder.add("corner", np.eye(4))
    builder.add("stool", np.eye(4), height=0.45)
    builder.add("carton to carry", np.eye(4), depth=0.3)
    assert used == {*things(), *scene_file.MADE}


def test_equal_seeds_furnish_equally_and_others_do_not() -> None:
    def corners(seed: int) -> np.ndarray:
        builder = SceneBuilder(np.random.default_rng(seed))
        builder.add("desk", np.eye(4), width=1.7, monitors=[-0.4, 0.4])
        return np.array([panel.origin for panel in builder.scene.panels])

    assert np.array_equal(corners(3), corners(3))
    assert corners(3).shape != corners(4).shape or not np.allclose(corners(3), corners(4))


def test_measures_are_numbers_or_expressions_of_other_measures(monkeypatch: pytest.MonkeyPatch) -> None:
    part = {"center": [0, 0, "h / 2"], "size": ["2 * (w - 0.1)", 1, "h"], "paint": "poster", "faces": "front"}
    scene = built({"measures": {"w": None, "h": "w + 1"}, "parts": [{"box": part}]}, monkeypatch, w=0.5)
    (front,) = scene.panels
    assert np.allclose(front.u, [0.8, 0, 0])
    assert np.allclose(front.v, [0, 0, -1.5])
    assert np.allclose(front.origin, [-0.4, -0.5, 1.5])


def test_a_part_is_repeated_for_all_combinations(monkeypatch: pytest.MonkeyPatch) -> None:
    light = {"for": {"x": [1, 2, 3], "y": ["x", "-x"]}, "at": ["x", "y", 0], "towards": [0, 0, -1], "power": [1, 1, 1]}
    (lamps,) = built({"parts": [{"light": light}]}, monkeypatch).lamps
    assert lamps.points.tolist() == [[x, s * x, 0] for x in (1, 2, 3) for s in (1, -1)]


@pytest.mark.parametrize(
    "part",
    [
        {"mug": {"place": [0, 0, 0]}},
        {"box": {"center": [0, 0, "height"], "size": [1, 1, 1], "paint": "poster"}},
        {"box": {"center": [0, 0, "__import__('os')"], "size": [1, 1, 1], "paint": "poster"}},
        {"box": {"center": [0, 0, "(1).real"], "size": [1, 1, 1], "paint": "poster"}},
        {"box": {"center": [0, 0, 0], "size": [1, 1, 1], "paint": "velvet"}},
        {"box": {"center": [0, 0, 0], "size": [1, 1, 1], "paint": {"plain": [9, 9, 9], "texel": 0.1}}},
        {"box": {"center": [0, 0, 0], "colour": 3}},
    ],
)
def test_what_the_file_must_not_hold_is_named(part: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigError, match=r"laboratory\.yaml"):
        built({"parts": [part]}, monkeypatch)


def test_an_unknown_measure_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ConfigError, match="depth"):
        built({"measures": {"width": 1}, "parts": []}, monkeypatch, depth=2)
