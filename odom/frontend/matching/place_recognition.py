"""Places seen before: an index by what they look like, matching by descriptors, and registration by the points."""

from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import numpy as np

from odom.frontend.features.place_descriptor import Place
from odom.frontend.matching.place_block import PlaceBlock, keys_of
from odom.frontend.matching.place_tables import PlaceTables
from odom.frontend.tuning import TUNING
from odom.registration import Pairs, Registration, register


@dataclass(eq=False)
class PlaceIndex:
    """Places by number, found by sampled bits of their descriptors (locality-sensitive hashing, A. Gionis, 1999).

    Of the places that share a feature's bits only the newest ones count, so that a place seen often hardly makes a
    look-up slower. Places of a saved map are in `blocks`; they are not in memory, like those that were set aside, but
    had from `elsewhere`.
    """

    places: dict[int, Place] = field(default_factory=dict)
    blocks: tuple[PlaceBlock, ...] = ()
    elsewhere: Callable[[int], Place | None] | None = None
    _tables: PlaceTables = field(default_factory=PlaceTables)

    def add(self, number: int, place: Place) -> None:
        """Remember `place` under `number`."""
        self.places[number] = place
        self._tables.add(number, place.descriptors)

    def forget(self, number: int) -> None:
        """Forget the place of this `number`, if there is one."""
        if self.places.pop(number, None) is not None:
            self._tables.forget(number)

    def set_aside(self, number: int) -> None:
        """Drop a place from memory; it is still found, and had from `elsewhere`."""
        self.places.pop(number, None)

    def place_of(self, number: int) -> Place | None:
        """Return a place that was found, None where it cannot be had any more."""
        place = self.places.get(number)
        return self.elsewhere(number) if place is None and self.elsewhere is not None else place

    def look_up(self, place: Place, excluded: set[int], most: int) -> list[int]:
        """Return up to `most` places that look most like `place`, best first, without the `excluded`."""
        keys = np.sort(keys_of(place.descriptors), axis=0)  # neighbouring keys are near each other in memory
        votes = np.bincount(np.concatenate([self._tables.voted(keys), *(block.voted(keys) for block in self.blocks)]))
        numbers = np.flatnonzero(votes)
        ranked = numbers[np.argsort(-votes[numbers], kind="stable")]
        return [number for number in ranked.tolist() if number not in excluded][:most]


def match_places(source: Place, target: Place) -> Pairs | None:
    """Return the pairs of features that look alike in both and unlike any other, None when there are fewer than 3."""
    if min(len(source.points), len(target.points)) < 3:
        return None
    matches = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(source.descriptors, target.descriptors, k=2)
    good = [
        (m.queryIdx, m.trainIdx)
        for m, second in matches
        if m.distance < min(TUNING.place_ratio * second.distance, TUNING.place_most_different)
    ]
    if len(good) < 3:
        return None
    s, t = np.array(good).T
    return Pairs(source.points[s], target.points[t], source.covariances[s], target.covariances[t])


@dataclass(frozen=True, eq=False)
class Recognition:
    """Place number `candidate`, which looks like another place, and the registration of the two (None: no matches)."""

    candidate: int
    registration: Registration | None

    @property
    def refusal(self) -> str:
        """Why the geometry refuses it; empty where it does not."""
        if self.registration is None:
            return "looks alike, but no features match"
        if not self.registration.ok:
            return f"looks alike, but {self.registration.reason}"
        if believable(self.registration):
            return ""
        return f"only {self.registration.inliers.sum()} of {len(self.registration.inliers)} matches agree"


def believable(registration: Registration) -> bool:
    """Return whether so many matches agree on the registration that look-alike places do not explain it."""
    return registration.ok and int(registration.inliers.sum()) >= TUNING.place_least_inliers


def recognise(index: PlaceIndex, place: Place, excluded: set[int]) -> list[Recognition]:
    """Return the places of `index`, without the `excluded` ones, that look most like `place`, each registered.

    The registration is `T_candidate_place`.
    """
    candidates = []
    for number in index.look_up(place, excluded, TUNING.place_candidates):
        known = index.place_of(number)
        if known is None:
            continue
        pairs = match_places(place, known)
        candidates.append(Recognition(number, None if pairs is None else register(pairs)))
    return candidates
