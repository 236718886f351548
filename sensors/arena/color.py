"""What a colour chip makes of light: exposure, white balance, vignetting, noise; 8 bit."""

import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled
from sensors.arena.noise import TILE, Tiles

Array = NDArray[np.float64]

LANES = (0, 32, 16)
"""Where red, green and blue lie in a packed sample."""


@compiled
def develop(
    light: NDArray[np.uint64],
    gain: NDArray[np.float32],
    vignette_x: NDArray[np.float32],
    vignette_y: NDArray[np.float32],
    noise_of: NDArray[np.float32],
    grain: NDArray[np.int8],
    at: NDArray[np.int64],
    out: NDArray[np.uint8],
) -> None:
    """Turn the light (see `shading.shade`) into the picture; `noise_of` (256) is the deviation at a value, over 24."""
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


def unpack(light: NDArray[np.uint64]) -> NDArray[np.uint8]:
    """Return the light as an 8 bit RGB image, without a chip's faults."""
    lanes = np.stack([light >> np.uint64(shift) & np.uint64(0xFFFF) for shift in LANES], axis=-1)
    return np.asarray((lanes + np.uint64(128)) >> np.uint64(8), np.uint8)


def noise_table() -> NDArray[np.float32]:
    """Return the deviation of each 8 bit display value: photon and read noise through the gamma curve, over 24."""
    linear = np.maximum(np.arange(256) / 255, 0.004) ** 2.2
    sigma = np.sqrt(0.016**2 * linear + 0.0024**2)
    slope = linear ** (1 / 2.2 - 1) / 2.2
    return np.asarray(np.clip(255 * sigma * slope, 1.2, 5.0) / 24, np.float32)


NOISE = noise_table()


def picture(
    light: NDArray[np.uint64], gain: tuple[float, float, float], tiles: Tiles, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Return the 8 bit RGB image of the light on the chip, at `gain` (display value, a colour each)."""
    height, width = light.shape
    x = np.linspace(-1, 1, width)
    y = np.linspace(-1, 1, height) * height / width
    out = np.empty((height, width, 3), np.uint8)
    develop(
        light,
        np.array(gain, np.float32),
        (1 - 0.05 * x**2).astype(np.float32),
        (1 - 0.05 * y**2).astype(np.float32),
        NOISE,
        tiles.grain,
        rng.integers(0, TILE, 2),
        out,
    )
    return out
