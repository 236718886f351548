"""What a colour chip makes of light: exposure, white balance, vignetting, noise; 8 bit."""

import numpy as np
from numpy.typing import NDArray

from odom.geometry.arrays import Image, Index
from odom.geometry.compiled import compiled
from sensors.arena.array_types import Float32, Light
from sensors.arena.noise_tiles import TILE, Tiles

LANES = (0, 32, 16)
"""The lowest bits of red, green and blue in a packed sample."""
VIGNETTE = 0.05
"""Share of light that is missing at the image's left and right edge: larger makes the corners darker."""


@compiled
def develop(
    light: Light,
    gain: Float32,
    vignette_x: Float32,
    vignette_y: Float32,
    noise_of: Float32,
    grain: NDArray[np.int8],
    at: Index,
    out: Image,
) -> None:
    """Turn the light into the picture; `noise_of` (256) is the deviation at a value, over 24."""
    height, width = light.shape
    values = np.empty((3, width), np.float32)
    for y in range(height):
        for x in range(width):
            fall = vignette_y[y] * vignette_x[x] * np.float32(1 / 256)
            packed = light[y, x]
            for c in range(3):
                lane = np.uint32(packed >> np.uint64(LANES[c]) & np.uint64(0xFFFF))
                values[c, x] = min(np.float32(lane) * gain[c] * fall, np.float32(255.0))
        row = grain[(y + at[0]) & (TILE - 1)]
        for x in range(width):
            column = (x + at[1]) & (TILE - 1)
            for c in range(3):
                value = values[c, x]
                value += noise_of[np.int32(value)] * np.float32(row[column, c])
                out[y, x, c] = np.uint8(min(max(value + np.float32(0.5), np.float32(0.0)), np.float32(255.0)))


def unpack(light: Light) -> Image:
    """Return the light as an 8 bit RGB image, without a chip's faults."""
    lanes = np.stack([light >> np.uint64(shift) & np.uint64(0xFFFF) for shift in LANES], axis=-1)
    return np.asarray((lanes + np.uint64(128)) >> np.uint64(8), np.uint8)


def noise_table() -> Float32:
    """Return the deviation of each 8 bit display value: photon and read noise through the gamma curve, over 24.

    Photon noise is 1.6 % of full scale at white and read noise 0.24 %; larger values make grainier pictures.
    """
    linear = np.maximum(np.arange(256) / 255, 0.004) ** 2.2
    sigma = np.sqrt(0.016**2 * linear + 0.0024**2)
    slope = linear ** (1 / 2.2 - 1) / 2.2
    return np.asarray(np.clip(255 * sigma * slope, 1.2, 5.0) / 24, np.float32)


NOISE = noise_table()


def picture(light: Light, gain: Float32, tiles: Tiles, rng: np.random.Generator) -> Image:
    """Return the 8 bit RGB image of the light on the chip, at `gain` (display value, a colour each)."""
    height, width = light.shape
    x = np.linspace(-1, 1, width)
    y = np.linspace(-1, 1, height) * height / width
    fall_x, fall_y = ((1 - VIGNETTE * at**2).astype(np.float32) for at in (x, y))
    out = np.empty((height, width, 3), np.uint8)
    develop(light, gain, fall_x, fall_y, NOISE, tiles.grain, rng.integers(0, TILE, 2), out)
    return out
