"""Degrades colour images: blurred, dark, badly exposed, compressed, torn. Shape, type and stamps stay as they are."""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.evaluation.robustness.spoiler import generator
from odom.frame import RgbdFrame, Stamp
from odom.geometry.arrays import Array

_READ_SIGMA = 2.0
"""Grey levels of noise that a small camera has without light."""
_SHOT_VARIANCE = 0.03
"""Variance that each grey level of light adds: photons come by chance."""
_SWING_S = 2.0
"""From bright to dark and back: automatic exposure that hunts."""
_TORN_ROWS = 16
"""Rows that are torn together."""
_TORN_BY = 0.125
"""Farthest shift of torn rows, as a share of the image's width."""
_DARK_FROM_S, _DARK_EVERY_S = 2.0, 8.0
"""The light goes out so long after the beginning, and then again after so long."""


def motion_blur(frame: RgbdFrame, length_px: float, seed: int) -> RgbdFrame:
    """Blur along a line of `length_px`, in another direction each frame; things stay where they were on average."""
    kernel = line_kernel(length_px, generator(seed, frame.stamp).uniform(0.0, np.pi))
    return _with_color(frame, cv2.filter2D(frame.color, -1, kernel))


def line_kernel(length_px: float, angle_rad: float) -> Array:
    """Return the kernel (odd size, sum 1) of a line through its middle; its length 0 is a single point."""
    reach = int(np.ceil(0.5 * length_px)) + 1
    points = 8 * reach
    along = ((np.arange(points) + 0.5) / points - 0.5) * length_px
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1))
    x, y = reach + along * np.cos(angle_rad), reach + along * np.sin(angle_rad)
    i, j = np.floor(y).astype(int), np.floor(x).astype(int)
    a, b = y - i, x - j
    for down, right, weight in ((0, 0, (1 - a) * (1 - b)), (0, 1, (1 - a) * b), (1, 0, a * (1 - b)), (1, 1, a * b)):
        np.add.at(kernel, (np.minimum(i + down, 2 * reach), np.minimum(j + right, 2 * reach)), weight)
    return np.asarray(kernel / kernel.sum())


def darkness(frame: RgbdFrame, light: float, seed: int) -> RgbdFrame:
    """Leave only a share `light` of the light, 1 to 0; the camera's noise (read and photon) does not shrink with it.

    The recording's own noise counts as that of a camera in full light, so at 1 nothing is added.
    """
    grey = np.arange(256, dtype=np.float32)
    sigma = np.sqrt(_READ_SIGMA**2 * (1.0 - light**2) + _SHOT_VARIANCE * grey * light * (1.0 - light))
    noise = generator(seed, frame.stamp).standard_normal(frame.color.shape, np.float32)
    noise *= sigma.astype(np.float32)[frame.color]
    noise += (light * grey)[frame.color]
    return _with_color(frame, np.clip(np.rint(noise, out=noise), 0, 255, out=noise).astype(np.uint8))


def exposure_swing(frame: RgbdFrame, stops: float, begin: Stamp) -> RgbdFrame:
    """Let the brightness swing by `stops` (factors of two) up and down; what is too bright is white."""
    gain = 2.0 ** (stops * np.sin(2.0 * np.pi / _SWING_S * (frame.stamp - begin) * 1e-9))
    table = np.clip(np.rint(gain * np.arange(256)), 0, 255).astype(np.uint8)
    return _with_color(frame, cv2.LUT(frame.color, table))


def jpeg(frame: RgbdFrame, quality: int) -> RgbdFrame:
    """Squeeze the image by JPEG of a `quality` from 1 to 99; 100 leaves it as it is."""
    if quality >= 100:
        return frame
    is_grey = frame.color.ndim == 2
    data = cv2.imencode(".jpg", frame.color if is_grey else frame.color[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    read = cv2.imdecode(data[1], cv2.IMREAD_GRAYSCALE if is_grey else cv2.IMREAD_COLOR_RGB)
    return _with_color(frame, np.asarray(read))


def torn_rows(frame: RgbdFrame, share: float, seed: int) -> RgbdFrame:
    """Shift a `share` of the bands of rows sideways, as lost packets do: each by up to an eighth of the width."""
    rng, color = generator(seed, frame.stamp), frame.color.copy()
    bands = -(-len(color) // _TORN_ROWS)
    is_torn = rng.random(bands) < share
    most = max(1, int(_TORN_BY * color.shape[1]))
    shifts = rng.integers(1, most + 1, bands) * rng.choice((-1, 1), bands)
    for band in np.flatnonzero(is_torn):
        rows = slice(band * _TORN_ROWS, (band + 1) * _TORN_ROWS)
        color[rows] = np.roll(frame.color[rows], int(shifts[band]), axis=1)
    return _with_color(frame, color)


def black_out(frame: RgbdFrame, seconds: float, begin: Stamp, seed: int) -> RgbdFrame:
    """Turn the light off for `seconds`, every eight seconds; depth brings light of its own and stays."""
    return frame if light_returns(frame.stamp, seconds, begin) == frame.stamp else darkness(frame, 0.0, seed)


def light_returns(stamp: Stamp, seconds: float, begin: Stamp) -> Stamp:
    """Return the stamp at which the black-out around `stamp` ends, `stamp` itself where there is light."""
    since_ns = (stamp - begin - round(_DARK_FROM_S * 1e9)) % round(_DARK_EVERY_S * 1e9)
    is_dark = stamp - begin >= _DARK_FROM_S * 1e9 and since_ns < seconds * 1e9
    return Stamp(stamp - since_ns + round(seconds * 1e9)) if is_dark else stamp


def _with_color(frame: RgbdFrame, color: NDArray[Any]) -> RgbdFrame:
    return replace(frame, color=np.asarray(color, dtype=np.uint8))
