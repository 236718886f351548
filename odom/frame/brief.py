"""One line about a value that holds arrays, for its `repr`."""

from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np


def brief(value: Any) -> str:
    """Return the fields of a dataclass on one line: a 4 x 4 pose in metres and degrees, other arrays by their shape.

    Fields that are None or empty are left out. A class uses it by `__repr__ = brief`.
    """
    shown = [f"{field.name}={_short(getattr(value, field.name))}" for field in fields(value)]
    return f"{type(value).__name__}({', '.join(text for text in shown if not text.endswith('='))})"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return _short_array(value)
    if value is None or (isinstance(value, str | tuple | list | dict) and not value):
        return ""
    if isinstance(value, tuple | list | dict) and len(value) > 3:
        return f"<{len(value)} entries>"
    if isinstance(value, float):
        return f"{value:.4g}"
    if is_dataclass(value):
        return brief(value)
    return str(value) if isinstance(value, Enum) else repr(value)


def _short_array(values: np.ndarray[Any, Any]) -> str:
    if values.dtype == np.bool_:
        return f"{np.count_nonzero(values)} of {values.size}"
    if values.shape == (4, 4) and values.dtype == np.float64:
        x, y, z = values[:3, 3]
        degrees = np.degrees(np.arccos(np.clip(0.5 * (np.trace(values[:3, :3]) - 1.0), -1.0, 1.0)))
        return f"<({x:.3f}, {y:.3f}, {z:.3f}) m, {degrees:.2f} deg>"
    return f"{values.dtype}[{' x '.join(str(n) for n in values.shape)}]"
