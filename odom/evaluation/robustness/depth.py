"""Degrades depth images: holes, little range, noise, coarse steps. Shape, type and stamps stay, and 0 for "nothing"."""

from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.evaluation.robustness.spoiler import Stream, generator
from odom.frame import RgbdFrame
from odom.geometry.arrays import Array
from odom.registration import KinectV1

_HOLE_PX = 24
"""Size of a hole, about."""
_KINECT_STEP = 2.73e-3
"""Step of a Kinect v1's inverse depth (1/m): 2.73 mm at 1 m (J. Smisek et al., ICCV Workshops 2011)."""


def holes(frame: RgbdFrame, share: float, seed: int) -> RgbdFrame:
    """Take away depth in blots of some 24 pixels that cover a `share` of the image, others in each frame."""
    if share <= 0:
        return frame
    height, width = frame.depth_mm.shape
    size = height // _HOLE_PX + 2, width // _HOLE_PX + 2
    coarse = generator(seed, frame.depth_stamp, Stream.DEPTH).standard_normal(size, np.float32)
    field = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    is_hole = field <= np.quantile(field[::8, ::8], share)
    return replace(frame, depth_mm=np.where(is_hole, np.uint16(0), frame.depth_mm))


def out_of_range(frame: RgbdFrame, range_m: float) -> RgbdFrame:
    """Take away depth beyond `range_m`, as in halls, or with cameras of little range."""
    return replace(frame, depth_mm=np.where(frame.depth_mm > 1e3 * range_m, np.uint16(0), frame.depth_mm))


def noise(frame: RgbdFrame, factor: float, seed: int) -> RgbdFrame:
    """Make depth as noisy as that of a Kinect v1 with `factor` times its error, in coarser steps; 1 changes nothing.

    The recording is taken to hold the error once already. Steps are even in inverse depth, `factor` - 1 Kinect's each.
    """
    sigma_mm, stepped_mm = _tables(factor)
    noisy = generator(seed, frame.depth_stamp, Stream.DEPTH).standard_normal(frame.depth_mm.shape, np.float32)
    noisy *= sigma_mm[frame.depth_mm]
    noisy += frame.depth_mm
    measured = np.clip(np.rint(noisy, out=noisy), 1, 65535, out=noisy).astype(np.uint16)
    return replace(frame, depth_mm=np.where(frame.depth_mm > 0, stepped_mm[measured], np.uint16(0)))


@lru_cache(maxsize=4)
def _tables(factor: float) -> tuple[NDArray[np.float32], NDArray[np.uint16]]:
    """Return the added sigma (mm) and the depth in steps (mm), both by the depth in millimetres."""
    depth_m = np.maximum(1, np.arange(65536)) * 1e-3
    added = np.sqrt(factor**2 - 1.0) * KinectV1().sigmas(depth_m)[1] * 1e3
    return added.astype(np.float32), np.clip(np.rint(1e3 * _stepped(depth_m, factor)), 1, 65535).astype(np.uint16)


def _stepped(depth_m: Array, factor: float) -> Array:
    step = (factor - 1.0) * _KINECT_STEP
    return np.asarray(1.0 / (step * np.maximum(np.rint(1.0 / depth_m / step), 1.0))) if step else depth_m
