"""Places seen before: an index by what they look like, matching by descriptors, and registration by the points."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from odom.frontend.features.place_descriptor import Place
from odom.frontend.matching.place_block import MOST_PLACES, PlaceBlock, keys_of
from odom.frontend.matching.tuning import TUNING
from odom.registration import Pairs, Registration, register

_LEAST_RATIO = 4
"""A block of the index is at least this many times as large as the next one, or the two are merged."""


@dataclass(frozen=True, eq=False)
class GrownIndex:
    """An index with `added` places: its blocks, and which of the places in them are forgotten."""

    added: Mapping[int, Place]
    blocks: tuple[PlaceBlock, ...]
    gone: frozenset[int]


@dataclass(eq=False)
class PlaceIndex:
    """Places by number, found by sampled bits of their descriptors (locality-sensitive hashing, A. Gionis, 1999).

    Of the places that share a feature's bits only the newest ones count, so that a place seen often hardly makes a
    look-up slower. Each of the `blocks` is smaller than the one before; they are merged as they fill, up to a bound, so
    that an entry is copied some four times for each size (a log-structured merge tree, P. O'Neil et al., 1996). Entries
    of forgotten places, which are `gone`, stay until then. Places that are not in memory are fetched from `elsewhere`.
    """

    places: dict[int, Place] = field(default_factory=dict)
    blocks: tuple[PlaceBlock, ...] = ()
    elsewhere: Callable[[int], Place | None] | None = None
    gone: frozenset[int] = frozenset()

    def snapshot(self) -> "PlaceIndex":
        """Return this index as it is now: what leaves memory meanwhile stays in it."""
        return replace(self, places=dict(self.places))

    def grown(self, added: Mapping[int, Place]) -> GrownIndex:
        """Return this index with further places of higher numbers; it stays as it is, and can be used meanwhile."""
        blocks = [block.without(self.gone) if self._is_half_gone(block) else block for block in self.blocks]
        for number, place in sorted(added.items()):
            blocks.append(PlaceBlock.of([number], [place.descriptors]))
            while len(blocks) > 1 and _is_to_be_merged(*blocks[-2:]):
                older, newer = (block.without(self.gone) for block in blocks[-2:])
                blocks[-2:] = [older.joined(newer)]
        left = self.gone.intersection(n for block in blocks for n in block.numbers.tolist())
        return GrownIndex(added, tuple(block for block in blocks if len(block.numbers)), left)

    def _is_half_gone(self, block: PlaceBlock) -> bool:
        return bool(self.gone) and 2 * np.isin(block.numbers, list(self.gone)).sum() > len(block.numbers)

    def adopt(self, grown: GrownIndex) -> None:
        """Become what `grown` has made of this index, if nothing was forgotten since."""
        self.places.update(grown.added)
        self.blocks, self.gone = grown.blocks, grown.gone

    def forget(self, number: int) -> None:
        """Forget the place of this `number`, if there is one."""
        if self.places.pop(number, None) is not None:
            self.gone |= {number}

    def set_aside(self, number: int) -> None:
        """Drop a place from memory; it is still found, and fetched from `elsewhere`."""
        self.places.pop(number, None)

    def place_of(self, number: int) -> Place | None:
        """Return the place of a number that was found, None where it cannot be fetched any more."""
        place = self.places.get(number)
        return self.elsewhere(number) if place is None and self.elsewhere is not None else place

    def look_up(self, place: Place, excluded: set[int], most: int) -> list[int]:
        """Return up to `most` places that look most like `place`, best first, without the `excluded`."""
        keys = np.sort(keys_of(place.descriptors), axis=0)  # neighbouring keys are near each other in memory
        size = 1 + max((int(block.numbers[-1]) for block in self.blocks), default=0)
        votes, is_gone = np.zeros(size, dtype=np.int64), np.zeros(size, dtype=np.bool_)
        is_gone[list(self.gone)] = True
        room = np.full(keys.shape, TUNING.place_bucket)
        for block in reversed(self.blocks):
            block.vote(keys, is_gone, room, votes)
        numbers = np.flatnonzero(votes)
        ranked = numbers[np.argsort(-votes[numbers], kind="stable")]
        return [number for number in ranked.tolist() if number not in excluded][:most]


def _is_to_be_merged(older: PlaceBlock, newer: PlaceBlock) -> bool:
    a, b = len(older.numbers), len(newer.numbers)
    return b * _LEAST_RATIO > a and a + b <= MOST_PLACES


def match_places(source: Place, target: Place) -> Pairs | None:
    """Return the pairs of features that look alike in both and unlike any other, None when there are fewer than 3."""
    if min(len(source.points), len(target.points)) < 3:
        return None
    bits, nearest = cv2.batchDistance(
        source.descriptors, target.descriptors, cv2.CV_32S, None, None, cv2.NORM_HAMMING, 2
    )
    s = np.flatnonzero(bits[:, 0] < np.minimum(TUNING.place_ratio * bits[:, 1], TUNING.place_most_different))
    if len(s) < 3:
        return None
    t = nearest[s, 0]
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


def recognise(index: PlaceIndex, place: Place, excluded: set[int], most: int | None = None) -> list[Recognition]:
    """Return the places of `index`, without the `excluded` ones, that look most like `place`, each registered.

    The registration is `T_candidate_place`. There are at most `most` of them; None: as many as the tuning says.
    """
    candidates = []
    for number in index.look_up(place, excluded, TUNING.place_candidates if most is None else most):
        known = index.place_of(number)
        if known is None:
            continue
        pairs = match_places(place, known)
        candidates.append(Recognition(number, None if pairs is None else register(pairs)))
    return candidates
