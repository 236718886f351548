"""Procedural pictures: landscapes, abstract paintings, charts."""

import cv2
import numpy as np

from odom.geometry.arrays import Image
from sensors.arena.lettering import text
from sensors.arena.materials import Random, clouds


def landscape(rng: Random, shape: tuple[int, int]) -> Image:
    """Return a view like a photograph: sky, sun, ridges fading into haze."""
    height, width = shape
    top, low = rng.integers((30, 80, 150), (90, 140, 220)), rng.integers((200, 170, 140), (255, 220, 210))
    ramp = np.linspace(0, 1, height)[:, None, None] ** 0.8
    image = np.broadcast_to(top * (1 - ramp) + low * ramp, (height, width, 3)).copy()
    image += (10 * clouds(shape, rng, (6, 3), 5))[..., None]
    sun = (int(rng.uniform(0.15, 0.85) * width), int(rng.uniform(0.15, 0.4) * height))
    cv2.circle(image, sun, max(2, height // 16), (255, 245, 215), -1, cv2.LINE_AA)
    ink = rng.integers((10, 40, 30), (60, 90, 70)).astype(float)
    for ridge in range(4):
        haze = 0.75 - 0.22 * ridge
        color = low * haze + ink * (1 - haze)
        line = clouds((2, width), rng, (2, 2 + ridge), 6)[0]
        crest = (height * (0.48 + 0.11 * ridge + 0.05 * line)).astype(int)
        below = np.arange(height)[:, None] >= crest
        shade = 1 + 0.12 * clouds(shape, rng, (24, 16), 4)
        image[below] = (color * shade[..., None])[below]
    return np.asarray(np.clip(image, 0, 255), np.uint8)


def abstract(rng: Random, shape: tuple[int, int]) -> Image:
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


def chart(rng: Random, shape: tuple[int, int]) -> Image:
    """Return axes with curves or bars."""
    height, width = shape
    image = np.full((height, width, 3), (250, 250, 248), np.uint8)
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
