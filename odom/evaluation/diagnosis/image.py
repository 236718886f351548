"""Exposure and sharpness of the colour images."""

from collections.abc import Sequence

import cv2
import numpy as np

from odom.evaluation.diagnosis.finding import Finding
from odom.frame import RgbdFrame
from odom.frontend.features.images import grey_of
from odom.geometry.arrays import Image

_TOO_BLURRED = 0.75
"""Largest `blur` (0 .. 1) of the usual image; larger misses faults."""
_DARK, _BRIGHT = 25.0, 230.0
"""Bounds of the mean grey value (0 .. 255) of the usual image; wider ones miss faults."""
_CLIPPED = 0.35
"""Largest share of black or white pixels in the usual image."""
_BLACK, _WHITE = 3, 252
"""Grey values at and beyond which a pixel counts as clipped: a camera's noise keeps it a little off the ends."""


def blur(image: Image) -> float:
    """Return how blurred an image is, 0 sharp .. 1 flat.

    A sharp image loses much of its variation when it is blurred again, a blurred one does not. F. Crete et al., "The
    blur effect: perception and estimation with a new no-reference perceptual blur metric", SPIE 2007.
    """
    values = image.astype(np.float32)
    worst = 0.0
    for axis, kernel in ((1, (9, 1)), (0, (1, 9))):
        before = np.abs(np.diff(values, axis=axis))
        after = np.abs(np.diff(cv2.blur(values, kernel), axis=axis))
        lost = np.maximum(before - after, 0.0)
        worst = max(worst, 1.0 - float(lost.sum()) / max(float(before.sum()), 1e-6))
    return worst


def judge_exposure(frames: Sequence[RgbdFrame]) -> Finding:
    """Judge brightness and the share of pixels at either end of the scale."""
    means = np.array([frame.color.mean() for frame in frames])
    clipped = np.array([np.mean((frame.color <= _BLACK) | (frame.color >= _WHITE)) for frame in frames])
    value = (
        f"mean {np.median(means):.0f} of 255 ({means.min():.0f} .. {means.max():.0f}), {np.median(clipped):.0%} clipped"
    )
    middle = float(np.median(means))
    is_bad = not _DARK <= middle <= _BRIGHT or float(np.median(clipped)) > _CLIPPED
    return Finding.judged("exposure", value, is_bad, "turn on the light, avoid windows in view, or set the exposure")


def judge_blur(frames: Sequence[RgbdFrame]) -> Finding:
    """Judge the sharpness; the worst tenth tells of motion blur."""
    values = np.array([blur(grey_of(frame.color)) for frame in frames])
    value = f"{np.median(values):.2f} (0 sharp, 1 flat), worst tenth {np.quantile(values, 0.9):.2f}"
    advice = "images are blurred: clean or focus the lens, turn on more light (shorter exposure), move slower"
    return Finding.judged("sharpness", value, float(np.median(values)) > _TOO_BLURRED, advice)
