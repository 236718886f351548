"""An index of places that grows: sorted tables of sampled bits, in levels of falling size that are merged as they fill.

A new place goes into the smallest level. A level that has come to more than a quarter of the one before is merged with
it, so that an entry is copied some four times for each level, however many places there are (a log-structured merge
tree, P. O'Neil et al., 1996); a look-up asks every level.
"""

from dataclasses import dataclass, field

import numpy as np

from odom.frontend.features.place_descriptor import Descriptors
from odom.frontend.matching.place_block import first_at_least, keys_of, last_of_each
from odom.frontend.tuning import TUNING
from odom.geometry.arrays import Index

_NUMBER_BITS = 32
"""Lower bits of an entry, which hold the place's number."""
_NUMBERS = (1 << _NUMBER_BITS) - 1
"""The bits of a place's number in an entry."""
_FALL = 4
"""How many times larger a level at least is than the next one."""


@dataclass(frozen=True, eq=False)
class _Level:
    """Entries, key and number of a place, sorted in each of the `tables`; the highest number is `newest`."""

    tables: tuple[Index, ...]
    newest: int

    @property
    def size(self) -> int:
        return len(self.tables[0])

    def joined(self, other: "_Level") -> "_Level":
        tables = tuple(np.sort(np.concatenate(both)) for both in zip(self.tables, other.tables, strict=True))
        return _Level(tables, max(self.newest, other.newest))

    def without(self, number: int) -> "_Level":
        return _Level(tuple(table[table & _NUMBERS != number] for table in self.tables), self.newest)


@dataclass(eq=False)
class PlaceTables:
    """Places by number, found by the sampled bits of their descriptors.

    It can be asked while another thread adds to it: the answer is that of before or after.
    """

    _levels: tuple[_Level, ...] = field(default=())
    """From the oldest and largest on: numbers of a level are higher than those of all before."""

    def add(self, number: int, descriptors: Descriptors) -> None:
        """Remember descriptors (n x 32) under `number`."""
        keys = keys_of(descriptors)
        levels = [*self._levels, _Level(tuple(np.unique(k) << _NUMBER_BITS | number for k in keys.T), number)]
        while len(levels) > 1 and (levels[-1].size * _FALL > levels[-2].size or number <= levels[-2].newest):
            levels[-2:] = [levels[-2].joined(levels[-1])]
        self._levels = tuple(levels)

    def forget(self, number: int) -> None:
        """Forget the place of this `number`."""
        self._levels = tuple(level.without(number) for level in self._levels)

    def voted(self, keys: Index) -> Index:
        """Return the places that share one of `keys` (n x TABLES), once for each; of each key the newest few."""
        room, found = np.full(keys.shape, TUNING.place_bucket), [np.zeros(0, dtype=np.int64)]
        for level in reversed(self._levels):
            for table, own, left in zip(level.tables, keys.T, room.T, strict=True):
                stop = first_at_least(table, (own + 1) << _NUMBER_BITS)
                count = np.minimum(stop - first_at_least(table, own << _NUMBER_BITS), left)
                left -= count
                found.append(table[last_of_each(stop, count)] & _NUMBERS)
        return np.concatenate(found)
