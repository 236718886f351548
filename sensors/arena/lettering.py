"""Print on procedural images: words, sentences, paragraphs."""

import cv2

from odom.geometry.arrays import Image
from sensors.arena.materials import Color, Random

_VOCABULARY = (
    "lidar pose loop frame depth drift robust filter noise range scan graph state laser robot motion vision camera "
    "optics sensor kalman horizon control field track point cloud mapping gain model fusion signal feature"
)
WORDS = _VOCABULARY.split()


def text(
    image: Image, words: str, at: tuple[int, int], height: float, color: Color, bold: bool = False, font: int = 0
) -> None:
    """Write `words` with its baseline's left end at `at` (x, y), letters about `height` texels tall."""
    scale = height / 22.0
    cv2.putText(image, words, at, font, scale, color, max(1, round(scale * (3.2 if bold else 1.6))), cv2.LINE_AA)


def sentence(rng: Random, letters: int) -> str:
    """Return about `letters` letters of words from robotics."""
    out = ""
    while len(out) < letters:
        out += str(rng.choice(WORDS)) + " "
    return out[:letters].strip()


def paragraph(image: Image, rng: Random, box: tuple[int, int, int, int], line: float, ink: Color) -> None:
    """Fill the box (x, y, width, height) with lines of print `line` texels apart."""
    x, y, width, height = box
    rows = int(height / line)
    for row in range(rows):
        letters = int(width / (line * 0.42))
        if row == rows - 1:
            letters = int(letters * rng.uniform(0.3, 0.8))
        if letters > 2:
            text(image, sentence(rng, letters), (x, int(y + (row + 0.75) * line)), line * 0.6, ink)
