"""Exposure and sharpness of the colour images."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.evaluation.diagnosis.finding import Finding, Verdict
from odom.frame import RgbdFrame

_TOO_BLURRED = 0.75
_DARK, _BRIGHT, _CLIPPED = 25.0, 230.0, 0.35


def blur(grey: NDArray[np.uint8]) -> float:
    """Return how blurred an image is, 0 sharp .. 1 flat.

    An image that is sharp loses much of its variation by another blur, a blurred one does not. F. Crete et al., "The
    blur effect: perception and estimation with a new no-reference perceptual blur metric", SPIE 2007.
    """
    image = grey.astype(np.float32)
    worst = 0.0
    for axis, kernel in ((1, (9, 1)), (0, (1, 9))):
        before = np.abs(np.diff(image, axis=axis))
        after = np.abs(np.diff(cv2.blur(image, kernel), axis=axis))
        lost = np.maximum(before - after, 0.0)
        worst = max(worst, 1.0 - float(lost.sum()) / max(float(before.sum()), 1e-6))
    return worst


def judge_exposure(frames: Sequence[RgbdFrame]) -> Finding:
    """Judge brightness and the share of pixels at either end of the scale."""
    means = np.array([frame.color.mean() for frame in frames])
    clipped = np.array([np.mean((frame.color <= 3) | (frame.color >= 252)) for frame in frames])
    value = (
        f"mean {np.median(means):.0f} of 255 ({means.min():.0f} .. {means.max():.0f}), {np.median(clipped):.0%} clipped"
    )
    middle = float(np.median(means))
    if middle < _DARK or middle > _BRIGHT or float(np.median(clipped)) > _CLIPPED:
        return Finding("exposure", value, Verdict.BAD, "turn on the light, avoid windows in view, or set the exposure")
    return Finding("exposure", value, Verdict.GOOD)


def judge_blur(frames: Sequence[RgbdFrame]) -> Finding:
    """Judge the sharpness; the worst tenth tells of motion blur."""
    values = np.array([blur(_grey(frame)) for frame in frames])
    value = f"{np.median(values):.2f} (0 sharp, 1 flat), worst tenth {np.quantile(values, 0.9):.2f}"
    if float(np.median(values)) > _TOO_BLURRED:
        return Finding(
            "sharpness", value, Verdict.BAD,
            "images are blurred: clean or focus the lens, turn on more light (shorter exposure), move slower",
        )  # fmt: skip
    return Finding("sharpness", value, Verdict.GOOD)


def _grey(frame: RgbdFrame) -> NDArray[np.uint8]:
    color = frame.color
    return color if color.ndim == 2 else np.asarray(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
