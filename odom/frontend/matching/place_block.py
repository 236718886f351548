"""Up to 4,096 places in an index that does not change any more: 4 bytes for each sampled key of each feature."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from odom.frontend.features.place_descriptor import Descriptors
from odom.geometry.arrays import Index, Mask
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
        tables = tuple(merged(a, b + shift) for a, b in zip(self.tables, newer.tables, strict=True))
        return PlaceBlock(np.concatenate([self.numbers, newer.numbers]), tables)

    def without(self, gone: Collection[int]) -> "PlaceBlock":
        """Return the block without the places `gone`."""
        stays = ~np.isin(self.numbers, list(gone))
        if stays.all():
            return self
        local, place = np.uint32(MOST_PLACES - 1), (np.cumsum(stays) - 1).astype(np.uint32)
        kept = [table[stays[table & local]] for table in self.tables]
        return PlaceBlock(self.numbers[stays], tuple((table & ~local) | place[table & local] for table in kept))

    def vote(self, keys: Index, is_gone: Mask, room: Index, votes: Index) -> None:
        """Add to `votes` one for each of `keys` (n x TABLES) that a place shares, the newest first.

        Each key counts at most as often as it has `room` (n x TABLES, which shrinks); places that are gone do not
        count. `is_gone` and `votes` are indexed by the places' numbers.
        """
        for t, table in enumerate(self.tables):
            stop = first_at_least(table, (keys[:, t] + 1) << _LOCAL_BITS)
            _vote(t, table, stop, keys, self.numbers, is_gone, room, votes)


@compiled
def _vote(
    t: int, table: NDArray[Any], stop: Index, keys: Index, numbers: Index, is_gone: Mask, room: Index, votes: Index
) -> None:
    for k in range(len(keys)):
        at = stop[k] - 1
        while at >= 0 and room[k, t] > 0 and np.int64(table[at]) >> _LOCAL_BITS == keys[k, t]:
            number = numbers[np.int64(table[at]) & (MOST_PLACES - 1)]
            if not is_gone[number]:
                votes[number] += 1
                room[k, t] -= 1
            at -= 1


@compiled
def merged(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Return two sorted arrays as a sorted one."""
    out = np.empty(len(a) + len(b), a.dtype)
    i = j = 0
    for k in range(len(out)):
        if j == len(b) or (i < len(a) and a[i] <= b[j]):
            out[k] = a[i]
            i += 1
        else:
            out[k] = b[j]
            j += 1
    return out


@compiled
def first_at_least(table: NDArray[Any], values: Index) -> Index:
    """Return where a sorted `table` first holds at least each of the values (n), as `np.searchsorted` does.

    All values are searched for in step, so that many memory accesses overlap instead of waiting for each other.
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
