"""One frame's grey image, scaled where it is small or large, and its half-size copy: features are searched in them."""

from dataclasses import dataclass

import cv2
import numpy as np

from odom.frontend.features.image_scale import scale_for, scaled_image
from odom.frontend.features.tuning import TUNING
from odom.geometry.arrays import Image, kept, uniform
from odom.geometry.normal_distribution import NORMAL_MAD

_SECOND_DIFFERENCE = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
"""Second difference along both axes: neither brightness nor slopes nor straight edges show in it."""
_SAMPLED_EVERY = 8
"""Distance of the sampled rows that suffice to show contrast in most images: 60 of 480 rows."""
_SURELY = 1.2
"""How many times the demanded contrast the sample must have: it tells that of the image to some per cent."""
_LEAST_SIGNAL = 0.5
"""Grey levels: less contrast is lost in rounding."""
_MIDDLE = 128.0
"""Grey level of the mean of an image whose contrast was raised."""
_STRONG = 4.0
"""Noise of more than this many times `image_clean` is smoothed by half as much again."""


def grey_of(color: Image) -> Image:
    """Return a colour image (H x W x 3 RGB) in grey (H x W); a grey one as it is."""
    return color if color.ndim == 2 else np.asarray(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def with_contrast(grey: Image) -> Image:
    """Return an image taken in the dark as if in the light: with contrast, and smoothed where that shows its noise.

    One that has contrast is returned as it is, and so is one that is mostly noise: there is nothing to see in it. The
    brightness of what is left does not depend on the exposure.
    """
    if cv2.meanStdDev(grey[::_SAMPLED_EVERY])[1][0, 0] >= _SURELY * TUNING.image_contrast:
        return grey
    mean, deviation = (float(value[0, 0]) for value in cv2.meanStdDev(grey))
    if deviation >= TUNING.image_contrast:
        return grey
    noise = noise_of(grey)
    signal = float(np.sqrt(max(deviation**2 - noise**2, 0.0)))
    if signal < max(noise, _LEAST_SIGNAL):
        return grey
    gain = max(1.0, TUNING.image_contrast / signal)
    image = np.asarray(grey, dtype=np.float32)
    if gain * noise > TUNING.image_clean:
        is_strong = gain * noise > _STRONG * TUNING.image_clean
        sigma_px = TUNING.image_smooth_px * (1.5 if is_strong else 1.0)
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), sigma_px), dtype=np.float32)
    level = _MIDDLE + (mean - _MIDDLE) / gain  # no jump where the gain sets in
    return np.asarray(np.clip(np.rint((image - mean) * gain + level), 0, 255), dtype=np.uint8)


def noise_of(grey: Image) -> float:
    """Return the standard deviation of an image's noise in grey levels, by the median of its second differences.

    J. Immerkaer, "Fast noise variance estimation", CVIU 1996, with the median, which texture hardly reaches.
    """
    differences = np.abs(cv2.filter2D(grey, cv2.CV_32F, _SECOND_DIFFERENCE)[1::3, 1::3])
    return float(np.median(differences)) * NORMAL_MAD / float(np.linalg.norm(_SECOND_DIFFERENCE))


@dataclass(frozen=True, eq=False)
class FrameImages:
    """`full` (H x W) and `half` (H/2 x W/2) grey images; pixel (u, v) of `full` is (u/2, v/2) of `half`.

    `full` is `scale` times as wide and high as the camera's image (see `image_scale`). Where it was enlarged,
    `enlarged_from` is that image with its contrast raised, otherwise None.
    """

    full: Image
    half: Image
    enlarged_from: Image | None
    scale: float

    @classmethod
    def of(cls, color: Image) -> "FrameImages":
        """Return the images of `color`, h x w x 3 RGB or h x w grey; they keep no part of its array."""
        scale = scale_for(color.shape)
        grey = scaled_image(grey_of(color), min(scale, 1.0))
        own = uniform(with_contrast(kept(grey) if grey is color else grey))
        full = uniform(scaled_image(own, max(scale, 1.0)))
        half = uniform(np.asarray(cv2.pyrDown(full), dtype=np.uint8))
        return cls(full, half, own if scale > 1.0 else None, scale)
