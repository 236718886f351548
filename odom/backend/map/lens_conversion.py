"""A map converted to another lens: measurements, landmarks and places; poses are left to an adjustment."""

from dataclasses import replace

import numpy as np

from odom.backend.map.map import Map
from odom.frontend.features.lens_change import LensChange
from odom.geometry.arrays import Array, Index


def positions_through(map_: Map, change: LensChange, rows: Index) -> tuple[Array, Array]:
    """Return where landmarks (`rows`, n) are as the key frames that made them see them through a new lens.

    Positions (n x 3, m, map frame), and inverse depths (n, 1/m) there.
    """
    L = map_.landmarks
    makers, of = np.unique(L.keyframe[rows], return_inverse=True)
    T_camera_map = np.array([map_.keyframes[k].T_camera_map for k in makers.tolist()]).reshape(-1, 4, 4)[of]
    positions, ratio = change.positions(L.position[rows], L.plane[rows, 1:], T_camera_map)
    return positions, L.plane[rows, 0] * ratio


def change_lens(map_: Map, change: LensChange) -> None:
    """Convert all that key frames measured, their landmarks and their places to the new lens."""
    L = map_.landmarks
    rows = np.flatnonzero(L.alive)
    L.position[rows], L.plane[rows, 0] = positions_through(map_, change, rows)
    for number in map_.remembered:
        map_.keyframes[number].change_lens(change)
    places = map_.places.places
    for number, place in list(places.items()):
        places[number] = replace(place, points=change.points(place.points))
