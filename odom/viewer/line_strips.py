"""Trajectories as lines: split where they are interrupted, whole or dashed."""

from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.viewer import entities, palette
from odom.viewer.entities import EntityUpdate, update

_DASHES = 1500
"""Dashes of a trajectory, each of three points: more slow a browser down, fewer make a long walk a dotted line."""
_SHORTEST_M = 0.05
"""Shortest dash, and what longer ones are doubled from: so lines that lie on each other have dashes of one length."""
_BY_EXTENT = 1 / 32
"""Longest dash, as a share of the room that a trajectory takes: shorter ones are specks in a view of the whole."""
LINE, DASH, TRUTH_DASH = -1.2, -2.2, -3.6
"""Radii of lines; Rerun reads negative ones as screen units, which stay as thick when one looks closer. Truth is the
thickest: where another line lies on it, its rim is seen."""
ONLINE_PHASE, TRUTH_PHASE, CHAIN_PHASE = 0, 1, 2
"""Where dashes begin, in thirds: lines that lie on each other stay visible."""


def lines(positions: Array, strips: NDArray[np.int64]) -> list[NDArray[np.float32]]:
    """Return the positions (n x 3) of each strip that has two at least."""
    if not len(positions):
        return []
    parts = np.split(positions.astype(np.float32), np.flatnonzero(np.diff(strips)) + 1)
    return [part for part in parts if len(part) > 1]


def dashes(strips: list[NDArray[np.float32]], phase: int) -> list[NDArray[np.float32]]:
    """Return every third piece along the strips, from piece `phase` (0, 1 or 2) on.

    Lines that lie on each other stay visible when they are dashed in different phases. Pieces are 5 cm long at a desk,
    longer in a hall, and so long that there are some 1500 at the most.
    """
    walked = [np.append(0.0, np.cumsum(np.linalg.norm(np.diff(strip, axis=0), axis=1))) for strip in strips]
    length = max(_dash_m(strips), sum(float(s[-1]) for s in walked) / (3 * _DASHES))
    pieces = []
    for strip, s in zip(strips, walked, strict=True):
        begins = np.arange(phase * length, s[-1], 3 * length)
        at = np.minimum(begins[:, None] + np.array([0.0, 0.5, 1.0]) * length, s[-1])
        points = np.stack([np.interp(at, s, strip[:, axis]) for axis in range(3)], axis=-1)
        pieces += list(points.astype(np.float32))
    return pieces


def _dash_m(strips: list[NDArray[np.float32]]) -> float:
    """Return the length of a dash that can be seen where all of the strips fill the view."""
    if not strips:
        return _SHORTEST_M
    low, high = np.min([s.min(axis=0) for s in strips], axis=0), np.max([s.max(axis=0) for s in strips], axis=0)
    doubled = np.floor(np.log2(max(1.0, float(np.linalg.norm(high - low)) * _BY_EXTENT / _SHORTEST_M)))
    return float(_SHORTEST_M * 2.0**doubled)


def truth_line(body: str, stamp: Stamp, positions: Array, strips: NDArray[np.int64]) -> EntityUpdate:
    """Return the true trajectory of a body, positions n x 3 in the map."""
    dashed = dashes(lines(positions, strips), TRUTH_PHASE)
    return strips_entity(f"{entities.TRUTH}/{body}", stamp, dashed, palette.TRUTH, TRUTH_DASH)


def strips_entity(
    path: str,
    stamp: Stamp,
    strips: Sequence[NDArray[np.floating]] | NDArray[np.floating],
    color: palette.Rgb,
    width: float = LINE,
    label: str | None = None,
) -> EntityUpdate:
    """Return the entity `path` with strips (each n x 3, map frame) of one colour, and a `label` in their middle."""
    labels = None if label is None or not len(strips) else [label]
    return update(path, stamp, rr.LineStrips3D(strips, colors=[color], radii=width, labels=labels, show_labels=True))
