"""Tiles of noise, made once; a frame takes its noise from a place in them that its number decides."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from sensors.arena.array_types import Float32

TILE = 512
"""Side of a tile in pixels, a power of two, for indices wrap round; smaller, its repetition shows in an image."""
WANDER_PX = 0.75
"""Deviation with which a matching window catches an edge beside its middle, pixels: larger, edges fray wider."""


class Tiles(NamedTuple):
    """`rough` (TILE x TILE, unit deviation) is even over patches of some 5 px, with grain.

    `wander` (2 x TILE x TILE, int8) are smooth shifts in whole pixels, some .75 px.
    `white` (TILE x TILE, unit deviation) differs from pixel to pixel.
    `grain` (TILE x TILE x 3, int8, deviation 24): a colour chip's, spread over neighbours by demosaicing.
    """

    rough: Float32
    wander: NDArray[np.int8]
    white: Float32
    grain: NDArray[np.int8]


def _smooth(rng: np.random.Generator, sigma: float) -> Float32:
    tile = rng.standard_normal((TILE, TILE), np.float32)
    wide = np.pad(tile, 16, mode="wrap")
    soft = np.asarray(cv2.GaussianBlur(wide, (0, 0), sigma))[16:-16, 16:-16]
    return np.asarray(soft / soft.std(), np.float32)


def make_tiles(seed: int) -> Tiles:
    """Return the tiles of a seed."""
    rng = np.random.default_rng([seed, 5])
    rough = 0.85 * _smooth(rng, 1.8) + 0.53 * _smooth(rng, 0.6)
    wander = np.stack([np.rint(WANDER_PX * _smooth(rng, 1.2)) for _ in range(2)]).astype(np.int8)
    color = [_smooth(rng, s) for s in (0.75, 0.55, 0.85)]
    grey = _smooth(rng, 0.5)
    grain = np.empty((TILE, TILE, 3), np.int8)
    for c in range(3):
        grain[..., c] = np.clip(24 * (0.8 * color[c] + 0.6 * grey), -127, 127)
    return Tiles(rough, wander, rng.standard_normal((TILE, TILE), np.float32), grain)


def frame_random(seed: int, frame: int, what: int) -> np.random.Generator:
    """Return the random numbers of one purpose (`what`) in one frame, whichever frames were drawn before."""
    return np.random.default_rng([seed, what, frame])
