"""Images of small cameras, enlarged before features are looked for, and the camera that would have taken them so.

Patches, cells and gates are tuned in pixels of images some 640 px wide. In one of 320 a patch, and a cell of the grid
that shows people move, would cover four times as much of the scene.
"""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera, DepthModel
from odom.frontend.features.tuning import TUNING
from odom.geometry.arrays import Array, Image, Scalar

_LARGEST = 4
"""Images are enlarged no further: what was not seen is not made by it, and it costs time."""


def factor_for(shape: tuple[int, ...]) -> int:
    """Return by how much images of a `shape` (rows, columns, ...) are enlarged: 1, 2 or 4."""
    factor = 1
    while factor < _LARGEST and factor * max(shape[:2]) < TUNING.image_least_side_px:
        factor *= 2
    return factor


def factor_of(camera: Camera) -> int:
    """Return by how much a camera's images are enlarged."""
    return factor_for((camera.height, camera.width))


def enlarged_camera(camera: Camera) -> Camera:
    """Return the camera that takes the enlarged images of `camera`, which sees the same; it itself where it is large.

    Fields of the depth model run over the image's width, and a stretch is a ratio: both stay.
    """
    f = factor_of(camera)
    if f == 1:
        return camera
    cx, cy = enlarged_uv(np.array([camera.cx, camera.cy]), f).tolist()
    vector = camera.depth.vector
    vector[:4] *= f  # shift (px) and baseline (px m)
    depth = DepthModel.of(vector)
    size = f * camera.width, f * camera.height
    return replace(camera, width=size[0], height=size[1], fx=f * camera.fx, fy=f * camera.fy, cx=cx, cy=cy, depth=depth)


def enlarged_image(image: Image, factor: int) -> Image:
    """Return an image (H x W or H x W x 3 uint8) enlarged by cubic interpolation."""
    if factor == 1:
        return image
    return np.asarray(cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)


def repeated(pixels: NDArray[Scalar], factor: int) -> NDArray[Scalar]:
    """Return a depth image or a mask (H x W) enlarged by repeating its pixels: between two depths there is nothing."""
    return pixels if factor == 1 else pixels.repeat(factor, axis=0).repeat(factor, axis=1)


def enlarged_uv(uv: Array, factor: int) -> Array:
    """Return where places in a small image (n x 2 px) are in the enlarged one."""
    return factor * (uv + 0.5) - 0.5


def own_uv(uv: Array, factor: int) -> Array:
    """Return where places in an enlarged image (n x 2 px) are in the camera's own."""
    return uv if factor == 1 else (uv + 0.5) / factor - 0.5
