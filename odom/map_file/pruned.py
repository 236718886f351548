"""A smaller map made of a large one: its most useful key frames, with the registrations that join them."""

from dataclasses import replace
from pathlib import Path

from odom.backend.map.map import Map
from odom.backend.map.memory import open_map, saved_keyframe
from odom.backend.map.pruning import forget
from odom.backend.map.thinning import landmarks_shown, least_telling
from odom.errors import ConfigError
from odom.frontend.features.image_scale import scaled_lens
from odom.map_file.inheritance import Family, Inherited
from odom.map_file.map_file import MapFile
from odom.map_file.new_map import Gathered, Origin, refuse_to_replace, renumbered, write_new


def prune(opened: MapFile, out: Path, keyframes: int) -> int:
    """Write a map `out` of some key frames of another one, and return their number.

    The first key frame of each part stays, even where these are more. A removed key frame passes its registrations to
    its heir (see `pruning`), and its landmarks to key frames that have measured them. Raises ConfigError where there is
    a file `out` already or nothing is to be left out, MapError where the map is damaged.
    """
    refuse_to_replace(out)
    sessions, count = opened.sessions(), len(opened.keyframes())
    if not sessions or count <= keyframes:
        raise ConfigError(f"{opened.path} has {count} key frames: give fewer")
    camera = sessions[0].camera
    every = Gathered([Origin(opened, n) for n in range(count)])
    saved = replace(opened.begin(camera), details=every, is_fixed=False)
    map_ = open_map(saved)
    map_.remembered, map_.away = sorted(map_.away), set()
    family = Family(every, [k.T_camera_map for k in map_.keyframes], _linked(map_), scaled_lens(camera))
    shown = landmarks_shown(map_, camera, lambda number: family.details(number).landmarks.position)
    for number in least_telling(shown, count - keyframes, {k.first for k in map_.keyframes}):
        forget(map_, number)
    new = {old: number for number, old in enumerate(map_.remembered)}
    edges = sorted(map_.registrations.among(new.keys()), key=lambda e: (min(e.a, e.b), max(e.a, e.b)))
    kept = replace(
        saved,
        keyframes=tuple(renumbered(saved_keyframe(map_, old), new) for old in new),
        edges=tuple(replace(e, a=new[e.a], b=new[e.b]) for e in edges),
        details=Inherited(family, list(new)),
    )
    write_new(out, sessions, kept)
    return len(new)


def _linked(map_: Map) -> list[list[int]]:
    """Return the key frames that each is linked with, nearest first."""
    each = zip(map_.keyframes, map_.links, strict=True)
    return [map_.nearest(sorted(linked), k.T_camera_map).tolist() for k, linked in each]
