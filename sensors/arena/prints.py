"""Procedural pictures with something on them: print, charts, landscapes, screens, a whiteboard."""

import cv2
import numpy as np

from sensors.arena.paint import Color, Painter, canvas, clouds, modulate, some_color
from sensors.arena.texture import Image

WORDS = [
    "lidar",
    "pose",
    "loop",
    "frame",
    "depth",
    "drift",
    "robust",
    "filter",
    "noise",
    "range",
    "scan",
    "graph",
    "state",
    "laser",
    "robot",
    "motion",
    "vision",
    "camera",
    "optics",
    "sensor",
    "kalman",
    "horizon",
    "control",
    "field",
    "track",
    "point",
    "cloud",
    "mapping",
    "gain",
    "model",
    "fusion",
    "signal",
    "feature",
]


def text(
    image: Image, words: str, at: tuple[int, int], height: float, color: Color, bold: bool = False, font: int = 0
) -> None:
    """Write `words` with its baseline's left end at `at` (x, y), letters about `height` texels tall."""
    scale = height / 22.0
    cv2.putText(image, words, at, font, scale, color, max(1, round(scale * (3.2 if bold else 1.6))), cv2.LINE_AA)


def sentence(rng: np.random.Generator, letters: int) -> str:
    """Return about `letters` letters of words from robotics."""
    out = ""
    while len(out) < letters:
        out += str(rng.choice(WORDS)) + " "
    return out[:letters].strip()


def paragraph(image: Image, rng: np.random.Generator, box: tuple[int, int, int, int], line: float, ink: Color) -> None:
    """Fill the box (x, y, width, height) with lines of print `line` texels apart."""
    x, y, width, height = box
    for row in range(int(height / line)):
        letters = int(width / (line * 0.42))
        if row == int(height / line) - 1:
            letters = int(letters * rng.uniform(0.3, 0.8))
        if letters > 2:
            text(image, sentence(rng, letters), (x, int(y + (row + 0.75) * line)), line * 0.6, ink)


def landscape(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return a photograph-like view: sky, sun, ridges fading into haze, water or meadow."""
    height, width = shape
    top, low = rng.integers((30, 80, 150), (90, 140, 220)), rng.integers((200, 170, 140), (255, 220, 210))
    ramp = np.linspace(0, 1, height)[:, None, None] ** 0.8
    image = np.broadcast_to(top * (1 - ramp) + low * ramp, (height, width, 3)).copy()
    image += (10 * clouds(shape, rng, (6, 3), 5))[..., None]
    sun = (int(rng.uniform(0.15, 0.85) * width), int(rng.uniform(0.15, 0.4) * height))
    cv2.circle(image, sun, max(2, height // 16), (255, 245, 215), -1, cv2.LINE_AA)
    ink = rng.integers((10, 40, 30), (60, 90, 70)).astype(float)
    columns = np.arange(width)
    for ridge in range(4):
        haze = 0.75 - 0.22 * ridge
        color = low * haze + ink * (1 - haze)
        line = clouds((2, width), rng, (2, 2 + ridge), 6)[0]
        crest = (height * (0.48 + 0.11 * ridge + 0.05 * line)).astype(int)
        below = np.arange(height)[:, None] >= crest[None, columns]
        shade = 1 + 0.12 * clouds(shape, rng, (24, 16), 4)
        image[below] = (color * shade[..., None])[below]
    return np.asarray(np.clip(image, 0, 255), np.uint8)


def abstract(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Return a painting of coloured panes with dark leading."""
    height, width = shape
    n = int(rng.integers(14, 40))
    seeds = rng.uniform((0, 0), (height, width), (n, 2))
    colors = rng.integers((40, 40, 40), (250, 230, 220), (n, 3))
    factor = 1 + 0.08 * clouds(shape, rng, (20, 20), 3)
    image = np.empty((height, width, 3), np.uint8)
    x = np.arange(width)[:, None]
    for y in range(height):
        distance = np.hypot(y - seeds[:, 0], x - seeds[:, 1])
        nearest, second = np.partition(distance, 1, axis=1)[:, :2].T
        row = colors[distance.argmin(axis=1)] * factor[y, :, None]
        row[second - nearest < max(1.5, width / 120)] = (25, 22, 20)
        image[y] = np.clip(row, 0, 255)
    return image


def chart(rng: np.random.Generator, shape: tuple[int, int], paper: Color = (250, 250, 248)) -> Image:
    """Axes with curves, points or bars."""
    height, width = shape
    image = np.full((height, width, 3), paper, np.uint8)
    x0, y0, x1, y1 = int(0.12 * width), int(0.08 * height), int(0.95 * width), int(0.85 * height)
    for k in range(6):
        y = y0 + (y1 - y0) * k // 5
        cv2.line(image, (x0, y), (x1, y), (205, 205, 205), 1, cv2.LINE_AA)
        text(image, f"{5 - k}", (int(0.03 * width), y + 3), max(5.0, height * 0.045), (60, 60, 60))
    inks = [(200, 40, 40), (30, 90, 190), (30, 140, 70), (220, 140, 20)]
    if rng.random() < 0.4:
        n = int(rng.integers(5, 10))
        for k in range(n):
            a = x0 + (x1 - x0) * k // n + 2
            top = int(y1 - (y1 - y0) * rng.uniform(0.15, 0.95))
            cv2.rectangle(image, (a, top), (a + int(0.7 * (x1 - x0) / n), y1), inks[k % 4], -1)
    else:
        for ink in inks[: int(rng.integers(2, 5))]:
            curve = clouds((2, x1 - x0), rng, (2, 3), 6)[0]
            ys = y1 - (y1 - y0) * np.clip(0.5 + 0.18 * curve, 0, 1)
            points = np.stack([np.arange(x0, x1), ys], axis=1).astype(np.int32)
            cv2.polylines(image, [points], False, ink, max(1, height // 110), cv2.LINE_AA)
    cv2.rectangle(image, (x0, y0), (x1, y1), (30, 30, 30), max(1, height // 150))
    return image


def poster(rng: np.random.Generator, texel_m: float = 0.002) -> Painter:
    """Return a painter of a scientific poster: head band, columns of print, charts and pictures."""

    def paint(width_m: float, height_m: float) -> Image:
        image = canvas(width_m, height_m, texel_m, (246, 246, 242))
        height, width = image.shape[:2]
        band = some_color(rng)
        head = int(0.14 * height)
        image[:head] = band
        size = 0.055 * height
        text(
            image,
            sentence(rng, int(width / size / 0.95)).title(),
            (width // 20, head // 2),
            size,
            (255, 255, 255),
            True,
        )
        text(image, sentence(rng, int(width / size)), (width // 20, int(0.85 * head)), size * 0.5, (235, 235, 220))
        columns = 3 if width > height else 2
        gap = width // 30
        column = (width - gap) // columns
        for k in range(columns):
            x, y = gap + k * column, head + gap
            while y < height - 2 * gap:
                block = int(rng.uniform(0.14, 0.26) * height)
                block = min(block, height - gap - y)
                inner = column - gap
                if block < 20:
                    break
                kind = rng.random()
                if kind < 0.45:
                    text(image, sentence(rng, 14).title(), (x, y + int(0.02 * height)), 0.02 * height, band, True)
                    paragraph(
                        image,
                        rng,
                        (x, y + int(0.03 * height), inner, block - int(0.03 * height)),
                        0.018 * height,
                        (50, 50, 50),
                    )
                elif kind < 0.75:
                    image[y : y + block, x : x + inner] = chart(rng, (block, inner))
                else:
                    picture = landscape if rng.random() < 0.5 else abstract
                    image[y : y + block, x : x + inner] = picture(rng, (block, inner))
                y += block + gap // 2
        return image

    return paint


def picture(rng: np.random.Generator, texel_m: float = 0.0022) -> Painter:
    """Return a painter of a photograph or painting with a mount."""
    view = landscape if rng.random() < 0.65 else abstract

    def paint(width_m: float, height_m: float) -> Image:
        image = canvas(width_m, height_m, texel_m, (240, 236, 226))
        height, width = image.shape[:2]
        b = min(height, width) // 12
        image[b:-b, b:-b] = view(rng, (height - 2 * b, width - 2 * b))
        return image

    return paint


def paper(rng: np.random.Generator, texel_m: float = 0.0016) -> Painter:
    """Return a painter of a printed sheet."""

    def paint(width_m: float, height_m: float) -> Image:
        image = canvas(width_m, height_m, texel_m, (244, 243, 238))
        height, width = image.shape[:2]
        m = width // 9
        text(image, sentence(rng, 16).title(), (m, height // 9), height * 0.035, (20, 20, 20), True)
        half = height // 2
        paragraph(image, rng, (m, height // 7, width - 2 * m, half - height // 7), height * 0.024, (60, 60, 60))
        if rng.random() < 0.6:
            image[half : height - m, m : width - m] = chart(rng, (height - m - half, width - 2 * m))
        else:
            paragraph(image, rng, (m, half, width - 2 * m, half - m), height * 0.024, (60, 60, 60))
        return image

    return paint


def screen(rng: np.random.Generator, texel_m: float = 0.002) -> Painter:
    """Return a painter of a monitor: an editor, a plot and windows."""

    def paint(width_m: float, height_m: float) -> Image:
        image = canvas(width_m, height_m, texel_m, (38, 42, 54))
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
        return image

    return paint


def whiteboard(rng: np.random.Generator, texel_m: float = 0.0024) -> Painter:
    """Return a painter of a whiteboard with formulas, sketches, wiped traces and notes."""

    def paint(width_m: float, height_m: float) -> Image:
        image = canvas(width_m, height_m, texel_m, (236, 239, 240))
        height, width = image.shape[:2]
        image = modulate(image, np.asarray(1 + 0.012 * clouds((height, width), rng, (4, 6), 4), np.float32))
        inks = [(30, 40, 130), (160, 30, 35), (25, 95, 50), (30, 30, 32)]
        formulas = ("x+ = A x + G y", "P = F P F' + Q", "R'R = I", "min |p - R q - t|", "Y += C' S C", "det(R) = 1")
        for _ in range(int(7 * width_m * height_m) + 4):
            at = (int(rng.uniform(0.03, 0.7) * width), int(rng.uniform(0.1, 0.95) * height))
            ink = inks[int(rng.integers(4))]
            text(
                image,
                str(rng.choice(formulas)),
                at,
                rng.uniform(0.03, 0.05) / texel_m,
                ink,
                font=cv2.FONT_HERSHEY_SCRIPT_SIMPLEX,
            )
        for _ in range(int(4 * width_m)):
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
        return image

    return paint
