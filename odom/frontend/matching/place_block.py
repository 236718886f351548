"""Up to 4,096 places in an index that does not change any more: 4 bytes for each sampled key of each feature."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from odom.frontend.features.place_descriptor import Descriptors
from odom.frontend.tuning import TUNING
from odom.geometry.arrays import Index
from odom.geometry.compiled import compiled

TABLES, BITS = 6, 20
"""Hash tables, and bits of a descriptor that each samples: a 1-in-a-million chance that unlike features share a key."""
_LOCAL_BITS = 32 - BITS
"""Lower bits of an entry: which place of the block."""
MOST_PLACES = 1 << _LOCAL_BITS
"""Places that a block can hold: as many as these bits can number."""
_SAMPLED = np.array([np.random.default_rng(t).choice(256, BITS, replace=False) for t in range(TABLES)])
_WEIGHTS = 1 << np.arange(BITS)
"""What each sampled bit counts in a key."""


def keys_of(descriptors: Descriptors) -> Index:
    """Return the sampled bits of n descriptors as numbers (n x TABLES)."""
    bits = np.unpackbits(descriptors, axis=1)[:, _SAMPLED].astype(np.int64)
    return np.asarray(bits @ _WEIGHTS)


@dataclass(frozen=True, eq=False)
class PlaceBlock:
    """The places `numbers` (ascending), and for each table its sorted entries: key and place in the block."""

    numbers: Index
    tables: tuple[NDArray[np.uint32], ...]

    @classmethod
    def of(cls, numbers: Sequence[int], descriptors: Sequence[Descriptors]) -> "PlaceBlock":
        """Return the block of places with these numbers, ascending, and descriptors (n x 32 each)."""
        entries: list[list[NDArray[np.uint32]]] = [[] for _ in range(TABLES)]
        for local, described in enumerate(descriptors):
            for table, keys in zip(entries, keys_of(described).T, strict=True):
                table.append((np.unique(keys) << _LOCAL_BITS | local).astype(np.uint32))
        nothing = np.zeros(0, np.uint32)
        tables = tuple(np.sort(np.concatenate([nothing, *table])) for table in entries)
        return cls(np.asarray(numbers, dtype=np.int64), tables)

    def joined(self, newer: "PlaceBlock") -> "PlaceBlock":
        """Return the block of these places and of `newer` ones, no more than MOST_PLACES together."""
        shift = np.uint32(len(self.numbers))
        tables = tuple(np.sort(np.concatenate([a, b + shift])) for a, b in zip(self.tables, newer.tables, strict=True))
        return PlaceBlock(np.concatenate([self.numbers, newer.numbers]), tables)

    def voted(self, keys: Index) -> Index:
        """Return the places that share one of `keys` (n x TABLES), once for each; of each key the newest few."""
        found = [_newest(table, own) for table, own in zip(self.tables, keys.T, strict=True)]
        return np.asarray(self.numbers[np.concatenate(found)])


def _newest(table: NDArray[np.uint32], keys: Index) -> Index:
    first = keys << _LOCAL_BITS
    stop = first_at_least(table, first + MOST_PLACES)
    count = np.minimum(stop - first_at_least(table, first), TUNING.place_bucket)
    return np.asarray(table[last_of_each(stop, count)] & np.uint32(MOST_PLACES - 1), dtype=np.int64)


@compiled
def first_at_least(table: NDArray[Any], values: Index) -> Index:
    """Return where a sorted `table` first holds at least each of the values (n), as `np.searchsorted` does.

    All values are sought in step: memory then works on many at a time, where it is waited for each in turn otherwise.
    """
    at = np.zeros(len(values), np.int64)
    step = 1
    while 2 * step <= len(table):
        step *= 2
    while step:
        for k in range(len(values)):
            probed = min(at[k] + step, len(table))
            is_below = np.int64(table[probed - 1]) < values[k]
            at[k] += (probed - at[k]) * is_below
        step //= 2
    return at


def last_of_each(stop: Index, count: Index) -> Index:
    """Return, one after the other, the `count` (n) positions before each `stop` (n), ascending."""
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return np.asarray(np.repeat(stop - count, count) + within)
