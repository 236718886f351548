"""Colours: M. Okabe and K. Ito's palette, which colour-blind people can tell apart, bright enough on black."""

import numpy as np
from numpy.typing import NDArray

Rgb = tuple[int, int, int]
Rgba = tuple[int, int, int, int]

ONLINE: Rgb = (230, 159, 0)  # the trajectory as it was published
CORRECTED: Rgb = (86, 180, 233)  # the trajectory as the map has it by now
UNJOINED: Rgb = (204, 121, 167)  # parts of it that nothing joins to the largest
TRUTH: Rgb = (240, 240, 240)  # what motion capture says
CHAIN: Rgb = (240, 228, 66)  # successive frames registered against each other alone
CHAIN_CLOSED: Rgb = (150, 100, 255)  # the same with the closures
BOUND: Rgb = (150, 150, 150)  # how large errors may be, by the covariance
LOOP_ACCEPTED: Rgb = (0, 200, 140)  # places that were recognised
LOOP_REFUSED: Rgb = (96, 62, 82)  # places that only looked so
ELLIPSOID: Rgba = (86, 180, 233, 120)  # where points and poses may be
GOOD: Rgb = (0, 200, 140)  # TRACKING
MOVING: Rgba = (255, 110, 60, 160)  # what moves in the image
WARN: Rgb = (240, 228, 66)  # UNCERTAIN
BAD: Rgb = (255, 110, 60)  # LOST, errors
LANDMARK: Rgba = (255, 255, 255, 110)  # points of the map
UNUSED: Rgba = (150, 150, 150, 110)  # features without a say

_RESIDUAL = np.array([[0, 200, 140], [240, 228, 66], [255, 90, 30]], dtype=np.float64)
"""The colours of residuals: green, yellow, red."""
_RESIDUAL_AT = (0.0, 1.5, 3.0)
"""At how many sigma each of them stands."""


def tinted(colors: NDArray[np.uint8], tint: Rgb) -> NDArray[np.uint8]:
    """Return n x 3 RGB half way to the tint."""
    return (colors // 2 + np.array(tint, dtype=np.uint8) // 2).astype(np.uint8)


def residual_colors(residual_sigma: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Return n x 4 RGBA: green at 0, yellow at 1.5 and red from 3 sigma on, dim grey where NaN (not used)."""
    used = np.isfinite(residual_sigma)
    values = np.where(used, np.abs(residual_sigma), 0.0)
    rgba = np.full((len(values), 4), 255, dtype=np.uint8)
    for channel in range(3):
        rgba[:, channel] = np.interp(values, _RESIDUAL_AT, _RESIDUAL[:, channel])
    rgba[~used] = UNUSED
    return rgba
