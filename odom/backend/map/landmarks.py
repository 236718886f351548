"""The landmarks of the map: arrays that grow, with one row for each landmark; rows of culled ones are used again."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from odom.backend.map.tuning import TUNING
from odom.frontend.features.patches import RADIUS
from odom.frontend.matching.landmark_search import LandmarkPatches
from odom.geometry.arrays import Array, Index, Mask

_SIDE = 2 * RADIUS + 1
"""Pixels across a stored patch."""
_FIRST_ROWS = 4096
"""Rows allocated at first, some 7 MB: a desk fits in."""


class Landmarks:
    """Surface points with the patch of image around them, as first seen by a key frame.

    Rows: `position` (3, m, map frame), `covariance` (3 x 3, m^2, map frame, given its key frame's pose), `keyframe`
    (number of the key frame it was first seen in), `uv` (2, px) and `plane` (inverse depth and its slope per pixel)
    there, `patch_full`, `patch_half`; `tried` and `seen` count the tracked frames in which it was looked for and
    found, `gone_s` for how long depth has looked through its place; `departed` is True from when it was seen to move
    until it is found where it was; `assumed` is True until depth is measured of it; `alive` is False for a row
    that may be used again; `identity` is never used again, so that an old observation of a row can be told from one of
    the new landmark there; `next_identity` is the first unused one.
    """

    def __init__(self) -> None:
        self._fields: dict[str, NDArray[Any]] = {
            "position": np.zeros((0, 3)),
            "covariance": np.zeros((0, 3, 3)),
            "keyframe": np.zeros(0, dtype=np.int64),
            "uv": np.zeros((0, 2)),
            "plane": np.zeros((0, 3)),
            "patch_full": np.zeros((0, _SIDE, _SIDE), dtype=np.uint8),
            "patch_half": np.zeros((0, _SIDE, _SIDE), dtype=np.uint8),
            "seen": np.zeros(0, dtype=np.int64),
            "tried": np.zeros(0, dtype=np.int64),
            "gone_s": np.zeros(0),
            "departed": np.zeros(0, dtype=np.bool_),
            "assumed": np.zeros(0, dtype=np.bool_),
            "alive": np.zeros(0, dtype=np.bool_),
            "identity": np.zeros(0, dtype=np.int64),
        }
        self.next_identity = 1
        self._bind()

    def _bind(self) -> None:
        self.position: Array = self._fields["position"]
        self.covariance: Array = self._fields["covariance"]
        self.keyframe: Index = self._fields["keyframe"]
        self.uv: Array = self._fields["uv"]
        self.plane: Array = self._fields["plane"]
        self.patch_full: NDArray[np.uint8] = self._fields["patch_full"]
        self.patch_half: NDArray[np.uint8] = self._fields["patch_half"]
        self.seen: Index = self._fields["seen"]
        self.tried: Index = self._fields["tried"]
        self.gone_s: Array = self._fields["gone_s"]
        self.departed: NDArray[np.bool_] = self._fields["departed"]
        self.assumed: NDArray[np.bool_] = self._fields["assumed"]
        self.alive: NDArray[np.bool_] = self._fields["alive"]
        self.identity: Index = self._fields["identity"]

    def add(
        self,
        position: Array,
        covariance: Array,
        keyframe: int,
        uv: Array,
        plane: Array,
        patch_full: NDArray[np.uint8],
        patch_half: NDArray[np.uint8],
        identity: Index | None = None,
    ) -> Index:
        """Add n landmarks first seen in `keyframe`; return their rows. Those of a saved map have an `identity` (n)."""
        n = len(position)
        rows = np.flatnonzero(~self.alive)[:n]
        if len(rows) < n:
            size = len(self.alive)
            grown = max(2 * size, size + n, _FIRST_ROWS)
            for name, old in self._fields.items():
                new = np.zeros((grown, *old.shape[1:]), dtype=old.dtype)
                new[:size] = old
                self._fields[name] = new
            self._bind()
            rows = np.flatnonzero(~self.alive)[:n]
        self.position[rows], self.covariance[rows], self.keyframe[rows] = position, covariance, keyframe
        self.uv[rows], self.plane[rows] = uv, plane
        self.patch_full[rows], self.patch_half[rows] = patch_full, patch_half
        self.seen[rows] = self.tried[rows] = 1
        self.gone_s[rows] = 0.0
        self.departed[rows] = self.assumed[rows] = False
        self.alive[rows] = True
        if identity is None:
            identity = self.next_identity + np.arange(n)
            self.next_identity += n
        self.identity[rows] = identity
        return rows

    @property
    def patches(self) -> LandmarkPatches:
        """What is needed to look for them in an image."""
        return LandmarkPatches(self.position, self.keyframe, self.uv, self.plane, self.patch_full, self.patch_half)

    def is_vague(self, rows: Index) -> Mask:
        """Return of which landmarks (n) the depth is hardly known: it was assumed, and no parallax has shown it yet."""
        is_vague = self.assumed.take(rows)
        if is_vague.any():
            variance_m2 = np.trace(self.covariance.take(rows, 0), axis1=1, axis2=2)
            is_vague &= variance_m2 * self.plane[rows, 0] ** 2 > TUNING.vague_depth**2
        return is_vague

    def cull(self, rows: Index) -> None:
        """Remove landmarks; their rows may be used again."""
        self.alive[rows] = False
        self.identity[rows] = 0
