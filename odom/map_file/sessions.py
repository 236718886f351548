"""The sessions of a map: when each was recorded, and with which camera."""

import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from odom.errors import ConfigError, MapError
from odom.frame import Camera
from odom.frame.depth_model import DepthModel
from odom.frontend.camera.lens import Lens
from odom.map_file.arrays import checked, unchecked

_SAME_PX = 1.0
"""Two calibrations are of one camera where no pixel's ray differs by more: then patches of one are found with the
other. Their models of depth errors may differ, which moves no landmark."""


@dataclass(frozen=True)
class Session:
    """One walk that is a part of a map: its `camera`, and the time of day at which it `begun` (ISO 8601)."""

    number: int
    begun: str
    camera: Camera

    def to_bytes(self) -> bytes:
        """Return the session's row."""
        return checked(json.dumps(asdict(self)).encode())

    @classmethod
    def of(cls, content: bytes) -> "Session":
        """Return the session of a row; raises MapError where it is damaged."""
        inside = unchecked(content)
        try:
            values: dict[str, Any] = json.loads(inside)
            depth = DepthModel(**values["camera"].pop("depth", {}))
            return cls(int(values["number"]), str(values["begun"]), Camera(**values["camera"], depth=depth))
        except (ValueError, KeyError, TypeError, AttributeError, ConfigError) as error:
            raise MapError(f"a session cannot be read: {error}") from error


def is_same_camera(a: Camera, b: Camera) -> bool:
    """Return whether two calibrations see the same, to a pixel."""
    if a == b:
        return True
    if (a.width, a.height) != (b.width, b.height):
        return False
    apart = np.abs(Lens.of(a).rays - Lens.of(b).rays).max(axis=(0, 1)) * (a.fx, a.fy)
    return bool(apart.max() < _SAME_PX)
