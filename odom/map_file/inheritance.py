"""Landmarks of key frames that are left out go to those that have measured them, the nearest first."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from odom.backend.map.reanchoring import joined, seen_from, take
from odom.backend.map.saved import SavedDetails, SavedLandmarks
from odom.errors import MapError
from odom.frontend.camera.lens import Lens
from odom.frontend.features.place_descriptor import Place
from odom.geometry import se3
from odom.geometry.arrays import Array, Index
from odom.map_file.new_map import Gathered


@dataclass(frozen=True, eq=False)
class Family:
    """All key frames of a map: their poses T_camera_map, by number, and those linked with each, nearest first."""

    every: Gathered
    T_camera_map: Sequence[Array]
    near: Sequence[Sequence[int]]
    lens: Lens

    def details(self, number: int) -> SavedDetails:
        """Return the details of a key frame; raises MapError where they cannot be read."""
        found = self.every.fetch(number)
        if found is None:
            raise MapError(f"key frame {number} cannot be read")
        return found


class Inherited:
    """Details of the key frames of a `family` that are `kept`, under new numbers (see `Details`)."""

    def __init__(self, family: Family, kept: Sequence[int]) -> None:
        self._family, self._kept = family, kept
        self._measured: dict[int, Index] = {n: family.details(n).identities for n in kept}
        gone = (n for n in range(len(family.T_camera_map)) if n not in self._measured)
        self._left: dict[int, Index] = {n: family.details(n).landmarks.identity for n in gone}
        self._shares = lru_cache(maxsize=64)(self._shares_of)

    def expect(self, numbers: Iterable[int]) -> None:
        """Read nothing ahead: each is fetched once, in order."""

    def fetch(self, number: int) -> SavedDetails:
        """Return the details of a key frame, with the landmarks that it inherits."""
        heir = self._kept[number]
        details = self._family.details(heir)
        own = details.landmarks
        for gone in sorted(self._left.keys() & set(self._family.near[heir])):
            if np.isin(self._left[gone], self._measured[heir]).any() and heir in (shares := self._shares(gone)):
                own = joined(own, shares[heir])
        return replace(details, landmarks=own)

    def fetch_place(self, number: int) -> Place | None:
        """Return the place alone, None where the key frame has none."""
        return self._family.every.fetch_place(self._kept[number])

    def _shares_of(self, gone: int) -> Mapping[int, SavedLandmarks]:
        """Return what each heir of a key frame gets: landmarks that it has measured and sees well enough."""
        family, left = self._family, self._family.details(gone).landmarks
        shares: dict[int, SavedLandmarks] = {}
        for heir in family.near[gone]:
            is_measured = np.isin(left.identity, self._measured.get(heir, ()))
            if not is_measured.any():
                continue
            T_heir_gone = family.T_camera_map[heir] @ se3.inverse(family.T_camera_map[gone])
            shares[heir] = seen_from(take(left, is_measured), T_heir_gone, family.lens)
            left = take(left, ~np.isin(left.identity, shares[heir].identity))
        return shares
