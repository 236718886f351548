"""Recognising a place: scale- and rotation-invariant features with their 3-D points, indexed by appearance."""

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.frontend.lens import Lens
from odom.frontend.measure import FeatureNoise, measure, points_of
from odom.frontend.timing import Timing
from odom.frontend.view import View
from odom.registration.pairs import Pairs

Array = NDArray[np.float64]
Descriptors = NDArray[np.uint8]
Entries = NDArray[np.int64]

_FEATURES = 700
_RATIO = 0.8
_MOST_DIFFERENT = 64
_TABLES, _BITS, _BUCKET = 6, 20, 24
_NUMBER_BITS = 32
_NUMBERS = (1 << _NUMBER_BITS) - 1


@dataclass(frozen=True, eq=False)
class Place:
    """n features of one frame: ORB descriptors (n x 32), points (n x 3, m, camera frame), covariances (n x 3 x 3)."""

    descriptors: Descriptors
    points: Array
    covariances: Array


def describe_place(view: View, lens: Lens, twist: Array, timing: Timing, noise: FeatureNoise) -> Place:
    """Return the place that a view shows (ORB: E. Rublee et al., ICCV 2011), seen while moving with `twist`."""
    orb = cv2.ORB.create(nfeatures=_FEATURES, fastThreshold=12)
    keypoints, descriptors = orb.detectAndCompute(view.images.full, None)
    if descriptors is None:
        return Place(np.zeros((0, 32), np.uint8), np.zeros((0, 3)), np.zeros((0, 3, 3)))
    uv = np.array([k.pt for k in keypoints], dtype=np.float64)
    variance = np.array([k.size / 31.0 for k in keypoints]) ** 2
    covariance_uv = np.stack([variance, np.zeros_like(variance), variance], axis=1)
    measured = measure(view.frame, lens, uv, covariance_uv, twist, timing, noise)
    deep = measured.values[:, 2] > 0.0
    points, covariances = points_of(measured.take(deep))
    return Place(np.asarray(descriptors, dtype=np.uint8)[deep], points, covariances)


def match_places(source: Place, target: Place) -> Pairs | None:
    """Return the pairs of features that look alike in both and unlike any other, None when there are fewer than 3."""
    if min(len(source.points), len(target.points)) < 3:
        return None
    matches = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(source.descriptors, target.descriptors, k=2)
    good = [
        (m.queryIdx, m.trainIdx) for m, second in matches if m.distance < min(_RATIO * second.distance, _MOST_DIFFERENT)
    ]
    if len(good) < 3:
        return None
    s, t = np.array(good).T
    return Pairs(source.points[s], target.points[t], source.covariances[s], target.covariances[t])


@dataclass(eq=False)
class PlaceIndex:
    """Places by number, found by sampled bits of their descriptors (locality-sensitive hashing, A. Gionis, 1999).

    A table holds an entry, sampled bits and number, for each feature of each place, in order. Of the places that share
    a feature's bits, the 24 of the highest numbers count, so that a look-up hardly costs more in a place often seen.
    """

    places: dict[int, Place] = field(default_factory=dict)
    _tables: list[Entries] = field(default_factory=lambda: [np.zeros(0, dtype=np.int64) for _ in range(_TABLES)])
    _sampled: Entries = field(
        default_factory=lambda: np.array(
            [np.random.default_rng(t).choice(256, _BITS, replace=False) for t in range(_TABLES)]
        )
    )

    def _keys(self, descriptors: Descriptors) -> Entries:
        bits = np.unpackbits(descriptors, axis=1)[:, self._sampled].astype(np.int64)
        return np.asarray(bits @ (1 << np.arange(_BITS)))

    def add(self, number: int, place: Place) -> None:
        """Remember `place` under `number`."""
        self.places[number] = place
        for t, keys in enumerate(self._keys(place.descriptors).T):
            entries = np.unique(keys) << _NUMBER_BITS | number
            self._tables[t] = np.insert(self._tables[t], np.searchsorted(self._tables[t], entries), entries)

    def forget(self, number: int) -> None:
        """Forget the place of this `number`, if there is one."""
        if self.places.pop(number, None) is not None:
            self._tables = [table[table & _NUMBERS != number] for table in self._tables]

    def look_up(self, place: Place, excluded: set[int], most: int) -> list[int]:
        """Return up to `most` places that look most like `place`, best first, without the `excluded`."""
        found = [
            _newest(table, keys) for table, keys in zip(self._tables, self._keys(place.descriptors).T, strict=True)
        ]
        numbers, votes = np.unique(np.concatenate(found), return_counts=True)
        ranked = numbers[np.argsort(-votes, kind="stable")]
        return [number for number in ranked.tolist() if number not in excluded][:most]


def _newest(table: Entries, keys: Entries) -> Entries:
    """Return the numbers that `table` holds under each of the `keys`, of each the highest 24."""
    stop = np.searchsorted(table, (keys + 1) << _NUMBER_BITS)
    start = np.maximum(np.searchsorted(table, keys << _NUMBER_BITS), stop - _BUCKET)
    count = stop - start
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return np.asarray(table[np.repeat(start, count) + within] & _NUMBERS)
