"""The systematic errors of a depth image: its place against the colour image, and its distances."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from odom.errors import ConfigError
from odom.geometry.arrays import Array

FIELD_TERMS = ("1", "x", "y", "xx", "xy", "yy")
"""Terms of a smooth field over the image, of x and y that run from -1 to 1 over its width, 0 in the middle."""
_EXACT = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Numbers of a depth that is right: scale 1, nothing else."""
_FIRST_GUESS, _LOOKS = 0.5, 3
"""Inverse depth (1/m) at which a colour pixel is first searched in a depth image seen from beside, and the number of
searches."""
_LEAST_INVERSE = 1.0 / 65.0
"""Least inverse depth (1/m) that fits into 16 bits of millimetres."""
_NO_FIELD = (0.0,) * len(FIELD_TERMS)
"""A field that is zero everywhere."""


LIKELY_MEDIAN_M = (0.25, 8.0)
"""Metres between which the median of a depth image lies: no depth camera for odometry has half of its pixels nearer or
farther. A narrower range calls good recordings bad, a wider one misses wrong units."""


@dataclass(frozen=True)
class DepthModel:
    """The relation of measured to true depth, z being the true distance in metres.

    The colour image lies `shift_px + baseline_px_m / z + stretch * (uv - middle)` right of and below the depth image:
    the first is a wrong table or offset, the second two cameras side by side whose distance was not corrected (focal
    length times distance), the third two focal lengths (1 - depth's / colour's); `uv` is the pixel in colour, `middle`
    that of the image. The inverse depth measured is `offset + scale / z`, both smooth fields over the image (see
    `FIELD_TERMS`, six coefficients, offset in 1/m): such are a structured-light sensor's errors of disparity, and its
    unit may be off.

    Raises ConfigError when a value is not finite, their number is another or the scale not positive.
    """

    shift_px: tuple[float, float] = (0.0, 0.0)
    baseline_px_m: tuple[float, float] = (0.0, 0.0)
    offset: tuple[float, ...] = _NO_FIELD
    scale: tuple[float, ...] = _EXACT
    stretch: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        for name, length in (("shift_px", 2), ("baseline_px_m", 2), ("offset", 6), ("scale", 6), ("stretch", 2)):
            values = tuple(float(value) for value in np.ravel(getattr(self, name)))
            if len(values) != length or not np.isfinite(values).all():
                raise ConfigError(f"{name} of the depth model: give {length} finite numbers, not {values}")
            object.__setattr__(self, name, values)
        if not self.scale[0] > sum(map(abs, self.scale[1:])):
            raise ConfigError(f"scale of the depth model {self.scale}: it would be negative somewhere in the image")

    def __repr__(self) -> str:
        """Return the values that differ from those of an exact depth image, for the log."""
        values = ((field, getattr(self, field.name)) for field in fields(self))
        named = ((field.name, value) for field, value in values if value != field.default)
        return f"DepthModel({', '.join(f'{name}={value}' for name, value in named)})"

    @property
    def vector(self) -> Array:
        """The 18 numbers in the order of the fields."""
        return np.array([*self.shift_px, *self.baseline_px_m, *self.offset, *self.scale, *self.stretch])

    @classmethod
    def of(cls, vector: Array) -> "DepthModel":
        """Return the model with such a `vector` (18 numbers, or 16 without stretch); raises ConfigError as above."""
        v = tuple(np.asarray(vector, dtype=np.float64).tolist())
        return cls(v[0:2], v[2:4], v[4:10], v[10:16], v[16:] or cls.stretch)


EXACT_DEPTH = DepthModel()
"""A depth image that lies exactly on the colour image and has no error."""


def field_terms(uv: Array, width: int, height: int) -> Array:
    """Return the terms (n x 6) of a field at pixels `uv` (n x 2)."""
    x = (uv[:, 0] - (width - 1) / 2) / (width / 2)
    y = (uv[:, 1] - (height - 1) / 2) / (width / 2)
    return np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def as_measured(model: Array, uv: Array, inverse_depth: Array, width: int, height: int) -> tuple[Array, Array, Array]:
    """Return where a depth image shows what colour shows at `uv` (n x 2), the inverse depth there, and its scale (n).

    `model` is a `DepthModel.vector`, `inverse_depth` (n, 1/m) the true one; the image is `width` x `height` pixels.
    """
    terms = field_terms(uv, width, height)
    scale = terms @ model[10:16]
    uv_depth = uv - aside_px(model, uv, inverse_depth, width, height)
    return uv_depth, terms @ model[4:10] + scale * inverse_depth, scale


def aside_px(model: Array, uv: Array, inverse_depth: Array, width: int, height: int) -> Array:
    """Return how far right of and below depth colour lies (n x 2, px) at `uv` (n x 2) of colour, `inverse_depth` (n).

    `model` is a `DepthModel.vector`, or the difference of two: it is linear in that.
    """
    from_middle = uv - ((width - 1) / 2, (height - 1) / 2)
    return np.asarray(model[0:2] + model[2:4] * inverse_depth[:, None] + model[16:18] * from_middle)


def corrected_depth(depth_mm: NDArray[np.uint16], model: DepthModel) -> NDArray[np.uint16]:
    """Return a depth image (H x W uint16, mm, 0: none) corrected: registered to the colour image, in true millimetres.

    For maps and pictures; the odometry corrects features alone. Each pixel is looked up where its own depth puts it.
    """
    if model == EXACT_DEPTH:
        return depth_mm
    height, width = depth_mm.shape
    v, u = np.mgrid[:height, :width]
    uv = np.column_stack([u.ravel(), v.ravel()])
    terms = field_terms(uv, width, height)
    far_u, far_v = (uv - aside_px(model.vector, uv, np.zeros(len(uv)), width, height)).T.reshape(2, height, width)
    offset, scale = ((terms @ np.array(field)).reshape(height, width) for field in (model.offset, model.scale))
    near = np.full((height, width), _FIRST_GUESS)
    for _ in range(_LOOKS if any(model.baseline_px_m) else 1):
        column = np.rint(far_u - model.baseline_px_m[0] * near).astype(np.int64)
        row = np.rint(far_v - model.baseline_px_m[1] * near).astype(np.int64)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        seen = np.where(inside, depth_mm[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)], 0)
        true = (1000.0 / np.maximum(seen, 1) - offset) / scale
        valid = (seen > 0) & (true > _LEAST_INVERSE)
        near = np.where(valid, true, near)
    return np.where(valid, np.rint(1000.0 / np.maximum(near, _LEAST_INVERSE)), 0).astype(np.uint16)
