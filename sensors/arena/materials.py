"""Procedural materials: paint, wood, carpet, ceiling tiles.

A texture makes painters; a painter is called with a surface's width and height in metres and returns its RGB image. The
generator of random numbers, shared by all painters of a room, makes each image another one.
"""

from collections.abc import Callable
from typing import Protocol

import cv2
import numpy as np

from odom.geometry.arrays import Image
from sensors.arena.array_types import Float32

Random = np.random.Generator
Painter = Callable[[float, float], Image]
Color = tuple[int, int, int]

STRIPE = 64
"""Rows worked on at a time: fewer are slower, more need more memory for large images."""


class Texture(Protocol):
    """Makes painters of one kind of image; `texel_m` is the side of a texel in metres."""

    def __call__(self, rng: Random, texel_m: float = ...) -> Painter:
        """Return a painter that draws its random numbers from `rng`."""


def texture(texel_m: float, background: Color) -> Callable[[Callable[[Image, Random], Image | None]], Texture]:
    """Turn a function that draws on an image of one colour (or returns another image) into a texture."""
    default_m = texel_m

    def decorate(draw: Callable[[Image, Random], Image | None]) -> Texture:
        def make(rng: Random, texel_m: float = default_m) -> Painter:
            def paint(width_m: float, height_m: float) -> Image:
                image = canvas(width_m, height_m, texel_m, background)
                drawn = draw(image, rng)
                return image if drawn is None else drawn

            return paint

        return make

    return decorate


def some_color(rng: Random) -> Color:
    """Return a colour as cloth, glaze and print have them: any hue, rarely strong."""
    hue, strength, value = rng.uniform(0, 6), rng.beta(2.0, 2.2), rng.uniform(0.2, 0.88)
    wheel = np.clip(np.abs((hue + np.array([0.0, 4.0, 2.0])) % 6 - 3) - 1, 0, 1)
    r, g, b = 255 * value * (1 - 0.85 * strength * (1 - wheel))
    return int(r), int(g), int(b)


def canvas(width_m: float, height_m: float, texel_m: float, color: Color) -> Image:
    """Return an image of one colour, at least 2 x 2."""
    shape = (max(2, round(height_m / texel_m)), max(2, round(width_m / texel_m)), 3)
    return np.full(shape, color, np.uint8)


def clouds(shape: tuple[int, int], rng: Random, cells: tuple[int, int], octaves: int = 4) -> Float32:
    """Return smooth noise (mean 0, deviation about 1): `cells` grid cells at first, doubled each octave."""
    total = np.zeros(shape, np.float32)
    weight = 1.0
    for octave in range(octaves):
        grid = (max(2, cells[0] << octave), max(2, cells[1] << octave))
        if grid[0] > shape[0] * 2 and grid[1] > shape[1] * 2:
            break
        coarse = rng.standard_normal(grid, np.float32)
        layer = np.asarray(cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_CUBIC), np.float32)
        layer *= weight
        total += layer
        weight *= 0.55
    return total


def modulate(image: Image, factor: Float32) -> Image:
    """Return `image` times `factor` (H x W), clipped."""
    out = np.empty_like(image)
    for top in range(0, len(image), STRIPE):
        part = slice(top, top + STRIPE)
        out[part] = np.clip(image[part] * factor[part, :, None], 0, 255)
    return out


def plain(rng: Random, color: Color, texel_m: float = 0.008, mottle: float = 0.03) -> Painter:
    """Return a painter of painted or moulded things: one colour with faint clouds and grain, `mottle` strong."""

    def paint(width_m: float, height_m: float) -> Image:
        image = canvas(width_m, height_m, texel_m, color)
        shape = image.shape[:2]
        cells = (max(2, int(height_m / 0.15)), max(2, int(width_m / 0.15)))
        factor = 1 + mottle * 0.6 * clouds(shape, rng, cells, 3) + mottle * 0.5 * rng.standard_normal(shape, np.float32)
        return modulate(image, factor)

    return paint


def wood(rng: Random, color: Color, texel_m: float = 0.003, plank_m: float = 0.0) -> Painter:
    """Return a painter of wood with its grain along the longer side; planks of `plank_m` width if given."""

    def grain(shape: tuple[int, int]) -> Float32:
        height, width = shape
        fine = clouds(shape, rng, (max(2, height // 3), max(2, width // 120)), 2)
        broad = clouds(shape, rng, (max(2, height // 24), max(2, width // 300)), 3)
        for row, wave in zip(fine, broad, strict=True):
            row[:] = 1 + 0.07 * row + 0.09 * np.sin(4 * wave)
        return fine

    def lay_planks(factor: Float32) -> None:
        height, width = factor.shape
        step, length = max(3, round(plank_m / texel_m)), round(1.1 / texel_m)
        for row, top in enumerate(range(0, height, step)):
            band = factor[top : top + step]
            band[:] = np.roll(band, int(rng.integers(width)), axis=1)
            for left in range(-int(rng.integers(length)), width, length):
                band[:, max(left, 0) : max(left + length, 0)] *= 1 + 0.11 * rng.standard_normal()
                if left > 0:
                    band[:, left : left + 1] *= 0.55
            band[:1] *= 0.55 if row else 1.0

    def paint(width_m: float, height_m: float) -> Image:
        turned = height_m > width_m
        image = canvas(max(width_m, height_m), min(width_m, height_m), texel_m, color)
        factor = grain(image.shape[:2])
        if plank_m:
            lay_planks(factor)
        image = modulate(image, factor)
        return np.ascontiguousarray(image.transpose(1, 0, 2)) if turned else image

    return paint


def rug(rng: Random, texel_m: float = 0.004) -> Painter:
    """Return a painter of a woven carpet with borders and rhombs."""
    inks = rng.integers((60, 25, 25), (215, 170, 140), (6, 3))

    def paint(width_m: float, height_m: float) -> Image:
        height, width = canvas(width_m, height_m, texel_m, (0, 0, 0)).shape[:2]
        yy, xx = np.arange(height)[:, None] * texel_m, np.arange(width) * texel_m
        cell = 0.22
        rhomb = (np.abs((xx / cell) % 1 - 0.5) + np.abs((yy / cell) % 1 - 0.5)) * 8
        which = (rhomb.astype(int) + (xx / cell).astype(int) * 3 + (yy / cell).astype(int) * 5) % 6
        edge = np.minimum(np.minimum(xx, width_m - xx), np.minimum(yy, height_m - yy))
        which = np.where(edge < 0.16, (edge / 0.04).astype(int) % 6, which)
        weave = 1 + 0.1 * rng.standard_normal((height, width)) + 0.06 * clouds((height, width), rng, (10, 10), 3)
        return modulate(inks[which].astype(np.uint8), weave.astype(np.float32))

    return paint


def ceiling(rng: Random, texel_m: float = 0.014) -> Painter:
    """Return a painter of acoustic tiles with holes in a metal grid."""

    def paint(width_m: float, height_m: float) -> Image:
        image = plain(rng, (232, 232, 226), texel_m, 0.02)(width_m, height_m)
        holes = rng.random(image.shape[:2]) < 0.06
        image[holes] = (image[holes] * 0.72).astype(np.uint8)
        step = round(0.6 / texel_m)
        for k in range(0, image.shape[0], step):
            image[k : k + 2] = 205
        for k in range(0, image.shape[1], step):
            image[:, k : k + 2] = 205
        return image

    return paint


def white(rng: Random, texel_m: float = 0.0) -> Painter:
    """Return a painter of nothing but white, as a lamp is."""
    return lambda width_m, height_m: np.full((8, 8, 3), 255, np.uint8)
