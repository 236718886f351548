"""Procedural pictures: wood, paint, paper, print, screens. Each painter returns an RGB image of a surface's size.

A painter is called with the surface's width and height in metres; a generator of random numbers makes it its own.
"""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from sensors.arena.texture import Image

Painter = Callable[[float, float], Image]
Color = tuple[int, int, int]
Float = NDArray[np.float32]

STRIPE = 64
"""Rows worked on at a time, so that large pictures need little memory."""
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


def some_color(rng: np.random.Generator) -> Color:
    """Return a colour as cloth, glaze and print have them: any hue, seldom loud."""
    hue, strength, value = rng.uniform(0, 6), rng.beta(2.0, 2.2), rng.uniform(0.2, 0.88)
    wheel = np.clip(np.abs((hue + np.array([0.0, 4.0, 2.0])) % 6 - 3) - 1, 0, 1)
    r, g, b = 255 * value * (1 - 0.85 * strength * (1 - wheel))
    return int(r), int(g), int(b)


def canvas(width_m: float, height_m: float, texel_m: float, color: Color) -> Image:
    """Return an image of one colour, at least 2 x 2."""
    shape = (max(2, round(height_m / texel_m)), max(2, round(width_m / texel_m)), 3)
    return np.full(shape, color, np.uint8)


def clouds(shape: tuple[int, int], rng: np.random.Generator, cells: tuple[int, int], octaves: int = 4) -> Float:
    """Return smooth noise (mean 0, deviation about 1): `cells` grid cells at first, doubled each octave."""
    total = np.zeros(shape, np.float32)
    weight = 1.0
    for octave in range(octaves):
        grid = (max(2, cells[0] << octave), max(2, cells[1] << octave))
        if grid[0] > shape[0] * 2 and grid[1] > shape[1] * 2:
            break
        coarse = rng.standard_normal(grid, np.float32)
        total += weight * np.asarray(cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_CUBIC), np.float32)
        weight *= 0.55
    return total


def modulate(image: Image, factor: Float) -> Image:
    """Return `image` times `factor` (H x W), clipped."""
    out = np.empty_like(image)
    for top in range(0, len(image), STRIPE):
        part = slice(top, top + STRIPE)
        out[part] = np.clip(image[part] * factor[part, :, None], 0, 255)
    return out


def plain(rng: np.random.Generator, color: Color, texel_m: float = 0.006, mottle: float = 0.03) -> Painter:
    """Return a painter of painted or moulded stuff: one colour with faint clouds and grain."""

    def paint(width_m: float, height_m: float) -> Image:
        image = canvas(width_m, height_m, texel_m, color)
        shape = image.shape[:2]
        cells = (max(2, int(height_m / 0.15)), max(2, int(width_m / 0.15)))
        factor = 1 + mottle * 0.6 * clouds(shape, rng, cells, 3) + mottle * 0.5 * rng.standard_normal(shape, np.float32)
        return modulate(image, factor)

    return paint


def wood(rng: np.random.Generator, color: Color, texel_m: float = 0.003, plank_m: float = 0.0) -> Painter:
    """Return a painter of wood grain along the longer side; planks of `plank_m` width if given."""

    def grain(shape: tuple[int, int]) -> Float:
        height, width = shape
        fine = clouds(shape, rng, (max(2, height // 3), max(2, width // 120)), 2)
        broad = clouds(shape, rng, (max(2, height // 24), max(2, width // 300)), 3)
        return np.asarray(1 + 0.07 * fine + 0.09 * np.sin(4 * broad), np.float32)

    def paint(width_m: float, height_m: float) -> Image:
        turned = height_m > width_m
        if turned:
            width_m, height_m = height_m, width_m
        image = canvas(width_m, height_m, texel_m, color)
        height, width = image.shape[:2]
        factor = grain((height, width))
        if plank_m:
            step = max(3, round(plank_m / texel_m))
            length = round(1.1 / texel_m)
            for row, top in enumerate(range(0, height, step)):
                band = factor[top : top + step]
                band[:] = np.roll(band, int(rng.integers(width)), axis=1)
                start = -int(rng.integers(length))
                for left in range(start, width, length):
                    a, b = max(left, 0), max(left + length, 0)
                    band[:, a:b] *= 1 + 0.11 * rng.standard_normal()
                    if left > 0:
                        band[:, left : left + 1] *= 0.55
                band[:1] *= 0.55 if row else 1.0
        image = modulate(image, factor)
        return np.ascontiguousarray(image.transpose(1, 0, 2)) if turned else image

    return paint


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
    yy, xx = np.mgrid[:height, :width]
    distance = np.hypot(yy[..., None] - seeds[:, 0], xx[..., None] - seeds[:, 1])
    order = np.partition(distance, 1, axis=2)
    colors = rng.integers((40, 40, 40), (250, 230, 220), (n, 3))
    image = colors[distance.argmin(axis=2)] * (1 + 0.08 * clouds(shape, rng, (20, 20), 3))[..., None]
    image[order[..., 1] - order[..., 0] < max(1.5, width / 120)] = (25, 22, 20)
    return np.asarray(np.clip(image, 0, 255), np.uint8)


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


def screen(rng: np.random.Generator, texel_m: float = 0.0017) -> Painter:
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


def window(rng: np.random.Generator, texel_m: float = 0.006) -> Painter:
    """Return a painter of the view out of a window: bright sky, houses, trees."""

    def paint(width_m: float, height_m: float) -> Image:
        image = canvas(width_m, height_m, texel_m, (235, 242, 250))
        height, width = image.shape[:2]
        ramp = np.linspace(0, 1, height)[:, None]
        image = np.clip(
            np.array([205, 225, 250])
            + ramp[..., None] * (40, 25, 5)
            + 4 * clouds((height, width), rng, (3, 4), 5)[..., None],
            0,
            255,
        ).astype(np.uint8)
        x = 0
        while x < width:
            w, top = int(rng.uniform(0.3, 0.6) / texel_m), int(rng.uniform(0.35, 0.6) * height)
            color = rng.uniform(150, 225) * np.array((1.0, rng.uniform(0.86, 0.97), rng.uniform(0.72, 0.9)))
            image[top:, x : x + w] = color
            for yy in range(top + 12, height - 8, 26):
                for xx in range(x + 8, min(x + w, width) - 14, 22):
                    image[yy : yy + 14, xx : xx + 10] = color * 0.55
            x += w
        trees = clouds((height, width), rng, (10, 14), 5) - 5.5 * (0.86 - ramp)
        image[trees > 0] = (
            np.array([75, 115, 60]) * (1 + 0.15 * clouds((height, width), rng, (40, 40), 3))[..., None]
        ).clip(0, 255)[trees > 0]
        return image

    return paint


def carton(rng: np.random.Generator, texel_m: float = 0.0028) -> Painter:
    """Return a painter of corrugated cardboard with tape, arrows and a label."""

    def paint(width_m: float, height_m: float) -> Image:
        image = plain(rng, (176, 138, 94), texel_m, 0.05)(width_m, height_m)
        height, width = image.shape[:2]
        image = modulate(
            image, np.broadcast_to(1 + 0.03 * np.sin(np.arange(width) * 1.1), (height, width)).astype(np.float32)
        )
        band = max(2, int(0.05 / texel_m))
        image[:, width // 2 - band // 2 : width // 2 + band // 2] = (
            image[:, width // 2 - band // 2 : width // 2 + band // 2] * 0.5 + np.array([205, 180, 130]) * 0.5
        ).astype(np.uint8)
        lw, lh = int(0.38 * width), int(0.4 * height)
        if min(lw, lh) > 12:
            x, y = int(rng.uniform(0.05, 0.5) * width), int(rng.uniform(0.1, 0.5) * height)
            label = np.full((lh, lw, 3), 242, np.uint8)
            for bar in range(lw // 10, lw - lw // 10, 3):
                label[lh // 8 : lh // 2, bar : bar + int(rng.integers(1, 3))] = 20
            paragraph(
                label, rng, (lw // 10, int(0.55 * lh), int(0.8 * lw), int(0.4 * lh)), max(6.0, lh / 8), (30, 30, 30)
            )
            part = image[y : y + lh, x : x + lw]
            part[:] = label[: part.shape[0], : part.shape[1]]
            size = 0.16 * height
            text(
                image,
                str(rng.choice(["FRAGILE", "THIS SIDE UP", "LAB 3", "KINECT", "ROBOT"])),
                (int(0.05 * width), int(0.95 * height)),
                size,
                (70, 40, 30),
                True,
            )
        return image

    return paint


def spine(rng: np.random.Generator, texel_m: float = 0.0018) -> Painter:
    """Return a painter of the back of a book or binder."""
    base = some_color(rng)

    def paint(width_m: float, height_m: float) -> Image:
        turned = canvas(height_m, width_m, texel_m, base)
        height, width = turned.shape[:2]
        ink: Color = (245, 240, 225) if sum(base) < 380 else (30, 25, 30)
        for k in (0.06, 0.1, 0.88, 0.94):
            turned[:, int(k * width) : int(k * width) + max(1, width // 70)] = ink
        text(
            turned,
            sentence(rng, int(rng.integers(9, 18))).title(),
            (int(0.16 * width), int(0.7 * height)),
            min(0.55 * height, 26.0),
            ink,
            rng.random() < 0.5,
        )
        factor = np.asarray(1 - 0.28 * np.abs(np.linspace(-1, 1, height)) ** 2, np.float32)[:, None]
        turned = modulate(turned, np.broadcast_to(factor, (height, width)).astype(np.float32))
        return np.ascontiguousarray(turned.transpose(1, 0, 2)[:, ::-1])

    return paint


def keyboard(rng: np.random.Generator, texel_m: float = 0.0018) -> Painter:
    """Return a painter of rows of keys."""

    def paint(width_m: float, height_m: float) -> Image:
        image = canvas(width_m, height_m, texel_m, (42, 43, 46))
        height, width = image.shape[:2]
        for row in range(5):
            y = int((row + 0.3) * height / 5.4)
            x = 4 + row * 2
            while x < width - 12:
                w = 10 if rng.random() < 0.9 else 20
                cv2.rectangle(image, (x, y), (min(x + w, width - 4), y + int(height / 7)), (84, 86, 90), -1)
                text(image, chr(65 + int(rng.integers(26))), (x + 2, y + int(height / 9)), 6, (225, 225, 225))
                x += w + 3
        return image

    return paint


def checker(squares: int = 8) -> Painter:
    """Return a painter of a calibration board."""

    def paint(width_m: float, height_m: float) -> Image:
        image = canvas(width_m, height_m, 0.0015, (246, 246, 246))
        height, width = image.shape[:2]
        side = int(width * 0.9 / squares)
        rows = int(height * 0.9 / side)
        x0, y0 = (width - squares * side) // 2, (height - rows * side) // 2
        for i in range(rows):
            for j in range(squares):
                if (i + j) % 2 == 0:
                    image[y0 + i * side : y0 + (i + 1) * side, x0 + j * side : x0 + (j + 1) * side] = (18, 18, 20)
        return image

    return paint


def rack(rng: np.random.Generator, texel_m: float = 0.0024) -> Painter:
    """Return a painter of fronts of laboratory instruments: knobs, sockets, displays."""

    def paint(width_m: float, height_m: float) -> Image:
        image = canvas(width_m, height_m, texel_m, (60, 62, 66))
        height, width = image.shape[:2]
        unit = max(24, int(0.09 / texel_m))
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
                    cv2.circle(
                        image,
                        center,
                        max(2, unit // 9),
                        [(220, 40, 40), (60, 220, 80), (240, 190, 40)][int(rng.integers(3))],
                        -1,
                        cv2.LINE_AA,
                    )
        return image

    return paint


def rug(rng: np.random.Generator, texel_m: float = 0.004) -> Painter:
    """Return a painter of a woven carpet with borders and rhombs."""
    inks = rng.integers((60, 25, 25), (215, 170, 140), (6, 3))

    def paint(width_m: float, height_m: float) -> Image:
        image = canvas(width_m, height_m, texel_m, (120, 40, 40))
        height, width = image.shape[:2]
        yy, xx = np.mgrid[:height, :width] * texel_m
        cell = 0.22
        rhomb = (np.abs((xx / cell) % 1 - 0.5) + np.abs((yy / cell) % 1 - 0.5)) * 8
        which = (rhomb.astype(int) + (xx / cell).astype(int) * 3 + (yy / cell).astype(int) * 5) % 6
        edge = np.minimum(np.minimum(xx, width_m - xx), np.minimum(yy, height_m - yy))
        which = np.where(edge < 0.16, (edge / 0.04).astype(int) % 6, which)
        image = inks[which].astype(np.uint8)
        weave = 1 + 0.1 * rng.standard_normal((height, width)) + 0.06 * clouds((height, width), rng, (10, 10), 3)
        return modulate(image, weave.astype(np.float32))

    return paint


def ceiling(rng: np.random.Generator, texel_m: float = 0.01) -> Painter:
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
