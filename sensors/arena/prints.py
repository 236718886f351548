"""Procedural images with something to read on them: posters, sheets, screens, a whiteboard; and framed pictures."""

import cv2
import numpy as np

from odom.geometry.arrays import Image
from sensors.arena.lettering import WORDS, paragraph, sentence, text
from sensors.arena.materials import Painter, Random, canvas, clouds, modulate, some_color, texture
from sensors.arena.pictures import abstract, chart, landscape


@texture(0.002, (246, 246, 242))
def poster(image: Image, rng: Random) -> None:
    """Draw a scientific poster: head band, columns of print, charts and pictures."""
    height, width = image.shape[:2]
    band = some_color(rng)
    head = int(0.14 * height)
    image[:head] = band
    size = 0.055 * height
    title = sentence(rng, int(width / size / 0.95)).title()
    text(image, title, (width // 20, head // 2), size, (255, 255, 255), True)
    text(image, sentence(rng, int(width / size)), (width // 20, int(0.85 * head)), size * 0.5, (235, 235, 220))
    columns = 3 if width > height else 2
    gap = width // 30
    column = (width - gap) // columns
    inner = column - gap
    for k in range(columns):
        x, y = gap + k * column, head + gap
        while y < height - 2 * gap:
            block = min(int(rng.uniform(0.14, 0.26) * height), height - gap - y)
            if block < 20:
                break
            kind = rng.random()
            if kind < 0.45:
                text(image, sentence(rng, 14).title(), (x, y + int(0.02 * height)), 0.02 * height, band, True)
                box = (x, y + int(0.03 * height), inner, block - int(0.03 * height))
                paragraph(image, rng, box, 0.018 * height, (50, 50, 50))
            else:
                draw = chart if kind < 0.75 else landscape if rng.random() < 0.5 else abstract
                image[y : y + block, x : x + inner] = draw(rng, (block, inner))
            y += block + gap // 2


def picture(rng: Random, texel_m: float = 0.0022) -> Painter:
    """Return a painter of a photograph or painting with a mount."""
    view = landscape if rng.random() < 0.65 else abstract

    def paint(width_m: float, height_m: float) -> Image:
        image = canvas(width_m, height_m, texel_m, (240, 236, 226))
        height, width = image.shape[:2]
        b = min(height, width) // 12
        image[b:-b, b:-b] = view(rng, (height - 2 * b, width - 2 * b))
        return image

    return paint


@texture(0.0016, (244, 243, 238))
def paper(image: Image, rng: Random) -> None:
    """Draw a printed sheet."""
    height, width = image.shape[:2]
    m = width // 9
    line, ink = height * 0.024, (60, 60, 60)
    text(image, sentence(rng, 16).title(), (m, height // 9), height * 0.035, (20, 20, 20), True)
    half = height // 2
    paragraph(image, rng, (m, height // 7, width - 2 * m, half - height // 7), line, ink)
    if rng.random() < 0.6:
        image[half : height - m, m : width - m] = chart(rng, (height - m - half, width - 2 * m))
    else:
        paragraph(image, rng, (m, half, width - 2 * m, half - m), line, ink)


@texture(0.002, (38, 42, 54))
def screen(image: Image, rng: Random) -> None:
    """Draw what a monitor shows: an editor, a plot and a picture."""
    height, width = image.shape[:2]
    inks = [(230, 120, 90), (120, 200, 140), (110, 170, 235), (225, 205, 130), (200, 200, 205)]
    split = int(width * rng.uniform(0.45, 0.6))
    image[: height // 18] = (70, 74, 88)
    line = height / 30
    for row in range(2, 28):
        x = int(line * (1 + rng.integers(0, 4)))
        while x < split - 3 * line and rng.random() < 0.85:
            word = str(rng.choice(WORDS))
            text(image, word, (x, int(row * line + line)), line * 0.65, inks[int(rng.integers(5))])
            x += int(line * (0.55 * len(word) + 0.7))
    half = height // 2
    image[height // 14 : half, split:-4] = chart(rng, (half - height // 14, width - 4 - split))
    image[half + 4 : -6, split:-4] = landscape(rng, (height - half - 10, width - 4 - split))


def whiteboard(rng: Random, texel_m: float = 0.0024) -> Painter:
    """Return a painter of a whiteboard with formulas, sketches, wiped traces and notes."""
    inks = [(30, 40, 130), (160, 30, 35), (25, 95, 50), (30, 30, 32)]
    formulas = ("x+ = A x + G y", "P = F P F' + Q", "R'R = I", "min |p - R q - t|", "Y += C' S C", "det(R) = 1")

    def sketch(image: Image) -> None:
        height, width = image.shape[:2]
        x, y = int(rng.uniform(0.05, 0.85) * width), int(rng.uniform(0.1, 0.8) * height)
        ink = inks[int(rng.integers(4))]
        size = int(rng.uniform(0.05, 0.14) / texel_m)
        kind = rng.random()
        if kind < 0.35:
            cv2.ellipse(image, (x, y), (size, size // 2), 0, 0, 360, ink, 2, cv2.LINE_AA)
            cv2.arrowedLine(image, (x + size, y), (x + 2 * size, y + size // 3), ink, 2, cv2.LINE_AA)
        elif kind < 0.6:
            cv2.rectangle(image, (x, y), (x + size, y + size // 2), ink, 2, cv2.LINE_AA)
            cv2.arrowedLine(image, (x + size, y + size // 4), (x + 2 * size, y), ink, 2, cv2.LINE_AA)
        else:
            note = [(250, 225, 90), (250, 160, 170), (150, 215, 150)][int(rng.integers(3))]
            side = int(0.075 / texel_m)
            image[y : y + side, x : x + side] = note
            paragraph(image, rng, (x + 3, y + 4, side - 6, side - 8), side / 5, (40, 40, 60))

    def paint(width_m: float, height_m: float) -> Image:
        image = canvas(width_m, height_m, texel_m, (236, 239, 240))
        height, width = image.shape[:2]
        image = modulate(image, np.asarray(1 + 0.012 * clouds((height, width), rng, (4, 6), 4), np.float32))
        for _ in range(int(7 * width_m * height_m) + 4):
            at = (int(rng.uniform(0.03, 0.7) * width), int(rng.uniform(0.1, 0.95) * height))
            ink, words = inks[int(rng.integers(4))], str(rng.choice(formulas))
            tall = rng.uniform(0.03, 0.05) / texel_m
            text(image, words, at, tall, ink, font=cv2.FONT_HERSHEY_SCRIPT_SIMPLEX)
        for _ in range(int(4 * width_m)):
            sketch(image)
        return image

    return paint
