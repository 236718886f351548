"""A smaller map made of a large one: the key frames that say most, held together by what tied them."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from odom.backend.map.memory import open_map, saved_keyframe
from odom.backend.map.pruning import forget
from odom.backend.map.thinning import landmarks_shown, least_telling
from odom.errors import ConfigError
from odom.geometry.arrays import Array
from odom.map_file.map_file import MapFile
from odom.map_file.new_map import Gathered, Origin, refuse_to_replace, renumbered, write_new


def prune(opened: MapFile, out: Path, keyframes: int) -> int:
    """Write the map `out` of at most so many key frames of another one, and return their number.

    The first key frame of each part stays, and where poses begin to be unsure of each other nothing falls apart: a
    key frame that goes leaves its registrations to its heir (see `pruning`). Raises ConfigError where there is a file
    `out` already or nothing is to be left out, MapError where the map is damaged.
    """
    refuse_to_replace(out)
    sessions = opened.sessions()
    if not sessions or len(opened.keyframes()) <= keyframes:
        raise ConfigError(f"{opened.path} has {len(opened.keyframes())} key frames: give fewer")
    camera = sessions[0].camera
    saved = replace(opened.begin(camera), is_fixed=False)
    every = Gathered([Origin(opened, k.number) for k in saved.keyframes])
    map_ = open_map(replace(saved, details=every))
    map_.remembered, map_.away = sorted(map_.away), set()

    def landmarks_of(number: int) -> Array:
        details = every.fetch(number)
        return np.zeros((0, 3)) if details is None else details.landmarks.position

    shown = landmarks_shown(map_, camera, landmarks_of)
    for number in least_telling(shown, len(saved.keyframes) - keyframes, {k.first for k in map_.keyframes}):
        forget(map_, number)
    new = {old: number for number, old in enumerate(map_.remembered)}
    edges = sorted(map_.registrations.among(new.keys()), key=lambda e: (min(e.a, e.b), max(e.a, e.b)))
    kept = replace(
        saved,
        keyframes=tuple(renumbered(saved_keyframe(map_, old), new) for old in new),
        edges=tuple(replace(e, a=new[e.a], b=new[e.b]) for e in edges),
        details=Gathered([Origin(opened, old) for old in new]),
    )
    write_new(out, sessions, kept)
    return len(new)
