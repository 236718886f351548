"""The size in which features are looked for: small images are enlarged, large ones reduced, and their camera with them.

Patches, cells and gates are tuned in pixels of images some 640 px wide. In one of 320 a patch, and a cell of the grid
that shows people move, would cover four times as much of the scene; in one of 1920, a ninth, at nine times the cost.
"""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera, DepthModel
from odom.frontend.camera.lens import Lens
from odom.frontend.features.tuning import TUNING
from odom.geometry.arrays import Array, Image, Mask, Scalar

_LARGEST = 4.0
"""Images are enlarged no further: what was not seen is not made by it, and it costs time."""
_SAME_SURFACE = 50
"""Depths that differ by less than one part in so many are averaged: of one surface, not of two behind each other."""


def scale_for(shape: tuple[int, ...]) -> float:
    """Return by what the sides of images of a `shape` (rows, columns, ...) are multiplied: a power of 2, often 1."""
    scale, side = 1.0, max(shape[:2])
    while scale < _LARGEST and scale * side < TUNING.image_least_side_px:
        scale *= 2.0
    while scale * side >= TUNING.image_most_side_px:
        scale /= 2.0
    return scale


def scale_of(camera: Camera) -> float:
    """Return by what the sides of a camera's images are multiplied."""
    return scale_for((camera.height, camera.width))


def _scaled_shape(shape: tuple[int, ...], scale: float) -> tuple[int, int]:
    """Return the rows and columns of images of a `shape` (rows, columns, ...) once scaled: whole blocks only."""
    return int(scale * shape[0]), int(scale * shape[1])


def scaled_camera(camera: Camera) -> Camera:
    """Return the camera that takes the scaled images of `camera`, which sees the same; it itself where they stay.

    Fields of the depth model run over the image's width, and a stretch is a ratio: both stay.
    """
    scale = scale_of(camera)
    if scale == 1.0:
        return camera
    height, width = _scaled_shape((camera.height, camera.width), scale)
    cx, cy = scaled_uv(np.array([camera.cx, camera.cy]), scale).tolist()
    vector = camera.depth.vector
    vector[:4] *= scale  # shift (px) and baseline (px m)
    return replace(
        camera,
        width=width,
        height=height,
        fx=scale * camera.fx,
        fy=scale * camera.fy,
        cx=cx,
        cy=cy,
        depth=DepthModel.of(vector),
    )


def scaled_lens(camera: Camera, frame_of: Camera | None = None) -> Lens:
    """Return the lens of the scaled images of `camera`; `frame_of` and errors are those of `Lens.of`."""
    return Lens.of(scaled_camera(camera), None if frame_of is None else scaled_camera(frame_of))


def scaled_image(image: Image, scale: float) -> Image:
    """Return an image (H x W or H x W x 3 uint8), enlarged by cubic interpolation or reduced to the means of blocks."""
    if scale == 1.0:
        return image
    height, width = _scaled_shape(image.shape, scale)
    whole = image[: round(height / scale), : round(width / scale)]
    how = cv2.INTER_CUBIC if scale > 1.0 else cv2.INTER_AREA
    return np.asarray(cv2.resize(whole, (width, height), interpolation=how), dtype=np.uint8)


def scaled_depth(depth_mm: NDArray[np.uint16], scale: float, whole_blocks: bool = False) -> NDArray[np.uint16]:
    """Return a depth image (H x W, 0: none) enlarged by repeating its pixels, or reduced by one value for each block.

    That is the nearest of the four pixels around the block's middle, or of all its pixels (`whole_blocks`), averaged
    with those of them that lie on the same surface: a mean of two surfaces would lie between them, where there is
    nothing.
    """
    if scale >= 1.0:
        return depth_mm if scale == 1.0 else _repeated(depth_mm, scale)
    by, (height, width) = round(1.0 / scale), _scaled_shape(depth_mm.shape, scale)
    used = range(by) if whole_blocks else (by // 2 - 1, by // 2)
    rows, columns = ([slice(k, n * by, by) for k in used] for n in (height, width))
    looked_at = [depth_mm[row, column] for row in rows for column in columns]
    nearest = np.minimum.reduce([each - np.uint16(1) for each in looked_at]) + np.uint16(1)  # none comes last: 0 - 1
    farthest = nearest.astype(np.uint32) + nearest // _SAME_SURFACE
    total, count = np.zeros((height, width), np.uint32), np.zeros((height, width), np.uint32)
    for each in looked_at:
        is_same = (each >= nearest) & (each <= farthest)
        total += each * is_same
        count += is_same
    return np.asarray((total + count // 2) // np.maximum(count, 1), dtype=np.uint16)


def scaled_mask(mask: Mask, scale: float) -> Mask:
    """Return a mask (H x W) enlarged by repeating its pixels, or reduced: one marked pixel marks its block."""
    if scale >= 1.0:
        return mask if scale == 1.0 else _repeated(mask, scale)
    by, (height, width) = round(1.0 / scale), _scaled_shape(mask.shape, scale)
    return np.asarray(mask[: height * by, : width * by].reshape(height, by, width, by).any(axis=(1, 3)))


def scaled_uv(uv: Array, scale: float) -> Array:
    """Return where places in the camera's own image (n x 2 px) are in the scaled one."""
    return scale * (uv + 0.5) - 0.5


def own_uv(uv: Array, scale: float) -> Array:
    """Return where places in a scaled image (n x 2 px) are in the camera's own."""
    return uv if scale == 1.0 else (uv + 0.5) / scale - 0.5


def _repeated(pixels: NDArray[Scalar], scale: float) -> NDArray[Scalar]:
    return pixels.repeat(int(scale), axis=0).repeat(int(scale), axis=1)
