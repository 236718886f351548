"""How a depth image errs: where it lies against the colour image, and what it says of a distance."""

from dataclasses import dataclass

import numpy as np

from odom.errors import ConfigError
from odom.geometry.arrays import Array

FIELD_TERMS = ("1", "x", "y", "xx", "xy", "yy")
"""Terms of a smooth field over the image, of x and y that run from -1 to 1 over its width, 0 in the middle."""
_EXACT = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_NO_FIELD = (0.0,) * len(FIELD_TERMS)


@dataclass(frozen=True)
class DepthModel:
    """What depth shows against what it should, z being the true distance in metres.

    The colour image lies `shift_px + baseline_px_m / z` right of and below the depth image: the first is a wrong table
    or offset, the second two cameras side by side whose distance was not corrected (focal length times distance).
    The inverse depth measured is `offset + scale / z`, both smooth fields over the image (see `FIELD_TERMS`, six
    coefficients, offset in 1/m): a structured-light sensor errs so in disparity, and its unit may be off.

    Raises ConfigError when a value is not finite, their number is another or the scale not positive.
    """

    shift_px: tuple[float, float] = (0.0, 0.0)
    baseline_px_m: tuple[float, float] = (0.0, 0.0)
    offset: tuple[float, ...] = _NO_FIELD
    scale: tuple[float, ...] = _EXACT

    def __post_init__(self) -> None:
        for name, length in (("shift_px", 2), ("baseline_px_m", 2), ("offset", 6), ("scale", 6)):
            values = tuple(float(value) for value in np.ravel(getattr(self, name)))
            if len(values) != length or not np.isfinite(values).all():
                raise ConfigError(f"{name} of the depth model: give {length} finite numbers, not {values}")
            object.__setattr__(self, name, values)
        if not self.scale[0] > sum(map(abs, self.scale[1:])):
            raise ConfigError(f"scale of the depth model {self.scale}: it would be negative somewhere in the image")

    @property
    def vector(self) -> Array:
        """The 16 numbers in the order of the fields."""
        return np.array([*self.shift_px, *self.baseline_px_m, *self.offset, *self.scale])

    @classmethod
    def of(cls, vector: Array) -> "DepthModel":
        """Return the model with such a `vector` (16); raises ConfigError as above."""
        v = tuple(np.asarray(vector, dtype=np.float64).tolist())
        return cls(v[0:2], v[2:4], v[4:10], v[10:])


EXACT_DEPTH = DepthModel()
"""A depth image that lies on the colour image and says what is true."""


def field_terms(uv: Array, width: int, height: int) -> Array:
    """Return the terms (n x 6) of a field at pixels `uv` (n x 2)."""
    x = (uv[:, 0] - (width - 1) / 2) / (width / 2)
    y = (uv[:, 1] - (height - 1) / 2) / (width / 2)
    return np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])
