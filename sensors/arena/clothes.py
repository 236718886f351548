"""The looks of people: printed shirts, trousers, skin, hair and shoes, wrapped around the prisms of a body."""

from collections.abc import Callable

import cv2
import numpy as np

from odom.geometry.arrays import Image
from sensors.arena.lettering import WORDS, text
from sensors.arena.materials import Color, Painter, Random, canvas, clouds, modulate, some_color
from sensors.arena.pictures import abstract, landscape

TEXEL_M = 0.003
"""Side of a texel of cloth and skin, metres: a pixel at 1.6 m; smaller needs more memory."""
SKINS: tuple[Color, ...] = ((236, 196, 168), (214, 166, 130), (166, 116, 82), (110, 74, 54))
"""Colours (RGB) of skin, from which each person is given one."""
HAIRS: tuple[Color, ...] = ((46, 34, 26), (28, 24, 24), (112, 78, 44), (150, 150, 150))
"""Colours (RGB) of hair, likewise."""
FRONT = 0.75
"""Where around a prism its front is, as a share of its circumference."""

Draw = Callable[[Image, Random], None]


def around(image: Image, side: int, sides: int) -> Painter:
    """Return the painter of one side of a prism of which `image` is wrapped around the whole."""
    columns = image.shape[1]
    strip = image[:, side * columns // sides : max((side + 1) * columns // sides, side * columns // sides + 2)]
    return lambda width_m, height_m: np.ascontiguousarray(strip)


def cloth(rng: Random, girth_m: float, height_m: float, color: Color, draw: Draw | None = None) -> Image:
    """Return an image of cloth with folds and weave, `draw` having printed on it."""
    image = canvas(girth_m, height_m, TEXEL_M, color)
    if draw is not None:
        draw(image, rng)
    shape = image.shape[:2]
    folds = 0.06 * clouds(shape, rng, (max(2, shape[0] // 60), max(2, shape[1] // 24)), 3)
    return modulate(image, np.asarray(1 + folds + 0.03 * rng.standard_normal(shape, np.float32), np.float32))


def stripes(image: Image, rng: Random) -> None:
    """Print stripes all around."""
    y, other = 0, some_color(rng)
    while y < len(image):
        wide, gap = (int(rng.uniform(0.012, 0.035) / TEXEL_M) for _ in range(2))
        image[y : y + wide] = other
        y += wide + gap


def checks(image: Image, rng: Random) -> None:
    """Print checks as of a shirt: bands in both directions that mix where they cross."""
    for axis in (0, 1):
        step = int(rng.uniform(0.03, 0.05) / TEXEL_M)
        for ink, wide in ((some_color(rng), step // 2), (some_color(rng), max(2, step // 8))):
            lines = (np.arange(image.shape[axis]) + int(rng.integers(step))) % step < wide
            part = image[lines] if axis == 0 else image[:, lines]
            mixed = (0.45 * part + 0.55 * np.array(ink)).astype(np.uint8)
            if axis == 0:
                image[lines] = mixed
            else:
                image[:, lines] = mixed


def dots(image: Image, rng: Random) -> None:
    """Print dots of one colour in rows, each a little off its place."""
    ink, step = some_color(rng), int(0.04 / TEXEL_M)
    for row, y in enumerate(range(step // 2, image.shape[0], step)):
        for x in range(step // 2 + (row % 2) * step // 2, image.shape[1], step):
            at = (x + int(rng.integers(-1, 2)), y + int(rng.integers(-1, 2)))
            cv2.circle(image, at, int(rng.integers(step // 6, step // 3)), ink, -1, cv2.LINE_AA)


def pictures(image: Image, rng: Random) -> None:
    """Print a picture with words on the front and on the back of a shirt."""
    height, width = image.shape[:2]
    size = int(0.26 / TEXEL_M), int(0.24 / TEXEL_M)
    for at, draw in ((FRONT, landscape), (FRONT - 0.5, abstract)):
        top, left = int(0.2 * height), int(at * width) - size[1] // 2
        bottom = min(top + size[0], height)
        image[top:bottom, left : left + size[1]] = draw(rng, size)[: bottom - top]
        text(image, str(rng.choice(WORDS)).upper(), (left, top - 4), 0.05 / TEXEL_M, (250, 240, 210), True)


PRINTS: tuple[Draw, ...] = (checks, stripes, pictures, dots)
"""Each person's shirt: of the first, the second and so on."""


def face(rng: Random, girth_m: float, height_m: float, skin: Color, hair: Color) -> Image:
    """Return a head unrolled: hair at the back, sides and top, eyes, brows, nose and mouth in front."""
    image = canvas(girth_m, height_m, TEXEL_M, skin)
    height, width = image.shape[:2]
    middle, part = int(FRONT * width), width // 40
    image[: int(0.24 * height)] = hair
    image[: int(0.75 * height), : int(0.52 * width)] = hair
    image[: int(0.5 * height), int(0.96 * width) :] = hair
    for side in (-1, 1):
        eye = (middle + side * 3 * part, int(0.46 * height))
        cv2.ellipse(image, eye, (max(2, part), max(1, part // 2 + 1)), 0, 0, 360, (240, 240, 236), -1, cv2.LINE_AA)
        cv2.circle(image, eye, max(1, part // 2), (46, 34, 28), -1, cv2.LINE_AA)
        brow = (eye[0], eye[1] - 2 * part)
        cv2.line(image, (brow[0] - part, brow[1]), (brow[0] + part, brow[1]), hair, max(1, part // 2), cv2.LINE_AA)
    shadow: Color = (int(0.8 * skin[0]), int(0.75 * skin[1]), int(0.75 * skin[2]))
    cv2.line(image, (middle, int(0.47 * height)), (middle, int(0.62 * height)), shadow, max(1, part), cv2.LINE_AA)
    at = (middle, int(0.77 * height))
    cv2.ellipse(image, at, (2 * part, max(1, part // 2)), 0, 0, 360, (166, 80, 76), -1, cv2.LINE_AA)
    grain = 1 + 0.04 * clouds((height, width), rng, (6, 10), 3) + 0.02 * rng.standard_normal((height, width))
    return modulate(image, np.asarray(grain, np.float32))
