"""Procedural images of what things show: a window's view, cartons, book spines, keys, instruments, a checkerboard."""

import cv2
import numpy as np

from odom.geometry.arrays import Image
from sensors.arena.lettering import paragraph, sentence, text
from sensors.arena.materials import Color, Painter, Random, canvas, clouds, modulate, plain, some_color, texture

WINDOW_M, RACK_M, CARTON_M, SPINE_M = 0.006, 0.0024, 0.0028, 0.0018
"""Side of a texel in metres: smaller shows finer detail and needs more memory."""


@texture(WINDOW_M, (235, 242, 250))
def window(image: Image, rng: Random) -> Image:
    """Draw the view out of a window: bright sky, houses, trees."""
    height, width = image.shape[:2]
    ramp = np.linspace(0, 1, height)[:, None]
    sky = np.array([205, 225, 250]) + ramp[..., None] * (40, 25, 5)
    image = np.clip(sky + 4 * clouds((height, width), rng, (3, 4), 5)[..., None], 0, 255).astype(np.uint8)
    x = 0
    while x < width:
        w, top = int(rng.uniform(0.3, 0.6) / WINDOW_M), int(rng.uniform(0.35, 0.6) * height)
        color = rng.uniform(150, 225) * np.array((1.0, rng.uniform(0.86, 0.97), rng.uniform(0.72, 0.9)))
        image[top:, x : x + w] = color
        for yy in range(top + 12, height - 8, 26):
            for xx in range(x + 8, min(x + w, width) - 14, 22):
                image[yy : yy + 14, xx : xx + 10] = color * 0.55
        x += w
    trees = clouds((height, width), rng, (10, 14), 5) - 5.5 * (0.86 - ramp) > 0
    leaves = np.array([75, 115, 60]) * (1 + 0.15 * clouds((height, width), rng, (40, 40), 3))[..., None]
    image[trees] = leaves.clip(0, 255)[trees]
    return image


def carton(rng: Random, texel_m: float = CARTON_M) -> Painter:
    """Return a painter of corrugated cardboard with tape and a label."""

    def paint(width_m: float, height_m: float) -> Image:
        image = plain(rng, (176, 138, 94), texel_m, 0.05)(width_m, height_m)
        height, width = image.shape[:2]
        ribs = np.broadcast_to(1 + 0.03 * np.sin(np.arange(width) * 1.1), (height, width)).astype(np.float32)
        image = modulate(image, ribs)
        band = max(2, int(0.05 / texel_m))
        tape = image[:, width // 2 - band // 2 : width // 2 + band // 2]
        tape[:] = (tape * 0.5 + np.array([205, 180, 130]) * 0.5).astype(np.uint8)
        lw, lh = int(0.38 * width), int(0.4 * height)
        if min(lw, lh) > 12:
            x, y = int(rng.uniform(0.05, 0.5) * width), int(rng.uniform(0.1, 0.5) * height)
            part = image[y : y + lh, x : x + lw]
            part[:] = label(rng, lw, lh)[: part.shape[0], : part.shape[1]]
            words = str(rng.choice(["FRAGILE", "THIS SIDE UP", "LAB 3", "KINECT", "ROBOT"]))
            text(image, words, (int(0.05 * width), int(0.95 * height)), 0.16 * height, (70, 40, 30), True)
        return image

    return paint


def label(rng: Random, width: int, height: int) -> Image:
    """Return a label with a bar code and some lines of print."""
    image = np.full((height, width, 3), 242, np.uint8)
    for bar in range(width // 10, width - width // 10, 3):
        image[height // 8 : height // 2, bar : bar + int(rng.integers(1, 3))] = 20
    box = (width // 10, int(0.55 * height), int(0.8 * width), int(0.4 * height))
    paragraph(image, rng, box, max(6.0, height / 8), (30, 30, 30))
    return image


def spine(rng: Random, texel_m: float = SPINE_M) -> Painter:
    """Return a painter of the back of a book or binder."""
    base = some_color(rng)

    def paint(width_m: float, height_m: float) -> Image:
        turned = canvas(height_m, width_m, texel_m, base)
        height, width = turned.shape[:2]
        ink: Color = (245, 240, 225) if sum(base) < 380 else (30, 25, 30)
        for k in (0.06, 0.1, 0.88, 0.94):
            turned[:, int(k * width) : int(k * width) + max(1, width // 70)] = ink
        title = sentence(rng, int(rng.integers(9, 18))).title()
        at = (int(0.16 * width), int(0.7 * height))
        text(turned, title, at, min(0.55 * height, 26.0), ink, rng.random() < 0.5)
        factor = np.asarray(1 - 0.28 * np.abs(np.linspace(-1, 1, height)) ** 2, np.float32)[:, None]
        turned = modulate(turned, np.broadcast_to(factor, (height, width)).astype(np.float32))
        return np.ascontiguousarray(turned.transpose(1, 0, 2)[:, ::-1])

    return paint


@texture(0.0018, (42, 43, 46))
def keyboard(image: Image, rng: Random) -> None:
    """Draw rows of keys."""
    height, width = image.shape[:2]
    for row in range(5):
        y = int((row + 0.3) * height / 5.4)
        x = 4 + row * 2
        while x < width - 12:
            w = 10 if rng.random() < 0.9 else 20
            cv2.rectangle(image, (x, y), (min(x + w, width - 4), y + int(height / 7)), (84, 86, 90), -1)
            text(image, chr(65 + int(rng.integers(26))), (x + 2, y + int(height / 9)), 6, (225, 225, 225))
            x += w + 3


@texture(RACK_M, (60, 62, 66))
def rack(image: Image, rng: Random) -> None:
    """Draw fronts of laboratory instruments: displays, knobs, lamps."""
    height, width = image.shape[:2]
    unit = max(24, int(0.09 / RACK_M))
    for y in range(4, height - unit + 1, unit):
        tone = int(rng.integers(40, 190))
        image[y : y + unit - 4, 6:-6] = (tone, tone, min(255, tone + 8))
        cv2.rectangle(image, (14, y + 6), (14 + width // 4, y + unit - 12), (15, 40, 30), -1)
        text(image, f"{rng.uniform(0, 99):.2f}", (18, y + unit - 16), unit * 0.4, (90, 250, 140))
        for x in range(width // 3 + 14, width - 20, max(14, int(unit * 0.55))):
            kind = rng.random()
            center = (x, y + unit // 2 - 2)
            if kind < 0.5:
                cv2.circle(image, center, max(3, unit // 6), (25, 25, 27), -1, cv2.LINE_AA)
                cv2.line(image, center, (x, y + unit // 3), (240, 240, 240), 1, cv2.LINE_AA)
            elif kind < 0.8:
                lamp = [(220, 40, 40), (60, 220, 80), (240, 190, 40)][int(rng.integers(3))]
                cv2.circle(image, center, max(2, unit // 9), lamp, -1, cv2.LINE_AA)


@texture(0.0015, (246, 246, 246))
def checkerboard(image: Image, rng: Random) -> None:
    """Draw a calibration board, eight squares wide."""
    height, width = image.shape[:2]
    side = int(width * 0.9 / 8)
    rows = int(height * 0.9 / side)
    x0, y0 = (width - 8 * side) // 2, (height - rows * side) // 2
    for i in range(rows):
        for j in range(i % 2, 8, 2):
            image[y0 + i * side : y0 + (i + 1) * side, x0 + j * side : x0 + (j + 1) * side] = (18, 18, 20)


def drawers(rng: Random, texel_m: float = 0.003) -> Painter:
    """Return a painter of the front of a chest of three drawers."""

    def paint(width_m: float, height_m: float) -> Image:
        image = plain(rng, (198, 199, 196), texel_m)(width_m, height_m)
        height, width = image.shape[:2]
        for k in range(3):
            y = k * height // 3
            image[y : y + 2] = 70
            image[y + height // 12 : y + height // 12 + 5, width // 3 : 2 * width // 3] = 60
        return image

    return paint
