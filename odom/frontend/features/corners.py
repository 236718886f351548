"""New corners, spread evenly over the image and away from features that are there already."""

import cv2
import numpy as np

from odom.frontend.features.images import noise_of
from odom.frontend.features.tuning import TUNING
from odom.geometry.arrays import Array, Image


def detect_corners(image: Image, occupied_uv: Array, cell: int, enlarged_from: Image | None = None) -> Array:
    """Return n x 2 whole-pixel corners (Shi-Tomasi, CVPR 1994): the best in each free `cell` x `cell` square.

    A square is free when none of the features `occupied_uv` (m x 2 px) lies in it; corners keep a distance from those.
    All are stronger than those that the image's own noise makes. Where `image` is `enlarged_from` another one, that one
    shows the noise: interpolated noise makes stronger corners, and does not show in second differences.
    """
    over_noise = TUNING.corner_over_noise if enlarged_from is None else TUNING.corner_over_enlarged_noise
    noise = noise_of(image if enlarged_from is None else enlarged_from)
    weakest = max(TUNING.corner_weakest, over_noise * noise**2)
    border, apart = TUNING.corner_border_px, TUNING.corner_apart_px
    response = cv2.cornerMinEigenVal(cv2.GaussianBlur(image, (3, 3), 0), 5, ksize=3)
    response[:border] = response[-border:] = 0.0
    response[:, :border] = response[:, -border:] = 0.0
    for u, v in occupied_uv.astype(int):
        response[max(0, v - apart) : v + apart + 1, max(0, u - apart) : u + apart + 1] = 0.0
    peak = (response == cv2.dilate(response, np.ones((5, 5)))) & (response > weakest)
    rows, columns = np.nonzero(peak)
    strongest_first = np.argsort(-response[rows, columns], kind="stable")
    rows, columns = rows[strongest_first], columns[strongest_first]
    across = image.shape[1] // cell + 1
    squares, first = np.unique((rows // cell) * across + columns // cell, return_index=True)
    taken = (occupied_uv[:, 1] // cell).astype(int) * across + (occupied_uv[:, 0] // cell).astype(int)
    keep = np.sort(first[~np.isin(squares, taken)])
    return np.stack([columns[keep], rows[keep]], axis=1).astype(np.float64)
