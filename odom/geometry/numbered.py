"""Set operations on arrays of identifying numbers: for some hundreds of them numpy's functions take too long."""

import numpy as np

from odom.geometry.arrays import Index
from odom.geometry.compiled import compiled

_MIX = 0x9E3779B97F4A7C15
"""2^64 over the golden ratio: multiplied by it, neighbouring numbers land far apart (D. Knuth, TAOCP 3, 6.4)."""


@compiled
def places_of(numbers: Index, among: Index) -> Index:
    """Return the place of each of n `numbers` in `among` (m, each once), -1 where it is not there."""
    bits = 4
    while 1 << bits < 2 * len(among):
        bits += 1
    mask, shift, factor = (1 << bits) - 1, np.uint64(64 - bits), np.uint64(_MIX)
    table = np.full(1 << bits, -1, np.int64)
    for place in range(len(among)):
        at = np.int64((np.uint64(among[place]) * factor) >> shift)
        while table[at] >= 0:
            at = (at + 1) & mask
        table[at] = place
    out = np.full(len(numbers), -1, np.int64)
    for k in range(len(numbers)):
        at = np.int64((np.uint64(numbers[k]) * factor) >> shift)
        while table[at] >= 0:
            if among[table[at]] == numbers[k]:
                out[k] = table[at]
                break
            at = (at + 1) & mask
    return out


def distinct(numbers: Index) -> Index:
    """Return which numbers there are among n small ones, none below 0, ascending; as `np.unique`, which hashes them."""
    return np.flatnonzero(np.bincount(numbers))


def shared(a: Index, b: Index) -> tuple[Index, Index]:
    """Return the places in `a` and in `b` (each number once in each) of the numbers that both hold, ascending."""
    places = places_of(a, b)
    here = np.flatnonzero(places >= 0)
    here = here[a[here].argsort()]
    return here, places[here]
