"""Colours: M. Okabe and K. Ito's palette, which colour-blind people can tell apart, bright enough on black."""

import numpy as np
from numpy.typing import NDArray

Rgb = tuple[int, int, int]
Rgba = tuple[int, int, int, int]

ONLINE: Rgb = (230, 159, 0)
CORRECTED: Rgb = (86, 180, 233)
UNJOINED: Rgb = (204, 121, 167)
TRUTH: Rgb = (240, 240, 240)
CHAIN: Rgb = (240, 228, 66)
CHAIN_CLOSED: Rgb = (150, 100, 255)
BOUND: Rgb = (150, 150, 150)
LOOP_ACCEPTED: Rgb = (0, 200, 140)
LOOP_REFUSED: Rgb = (96, 62, 82)
ELLIPSOID: Rgba = (86, 180, 233, 120)
GOOD: Rgb = (0, 200, 140)
MOVING: Rgba = (255, 110, 60, 160)
WARN: Rgb = (240, 228, 66)
BAD: Rgb = (255, 110, 60)
LANDMARK: Rgba = (255, 255, 255, 110)
UNUSED: Rgba = (150, 150, 150, 110)

_RESIDUAL = np.array([[0, 200, 140], [240, 228, 66], [255, 90, 30]], dtype=np.float64)
_RESIDUAL_AT = (0.0, 1.5, 3.0)
"""The colours of residuals, and at how many sigma each stands."""


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
