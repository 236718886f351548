"""How much a map holds: written in every transaction, so that what is missing is noticed."""

from dataclasses import astuple, dataclass

import numpy as np

from odom.errors import MapError
from odom.map_file.arrays import pack, unpack


@dataclass(frozen=True)
class Counts:
    """Rows of the tables that are read as a whole, and the first identity not yet given to a landmark."""

    keyframes: int = 0
    edges: int = 0
    next_identity: int = 1

    def to_bytes(self) -> bytes:
        """Return the row."""
        return pack({"counts": np.array(astuple(self), dtype=np.int64)})

    @classmethod
    def of(cls, content: bytes) -> "Counts":
        """Return the counts of a row; raises MapError where it is damaged."""
        values = unpack(content)["counts"].tolist()
        if len(values) != 3:
            raise MapError("the counts cannot be read")
        return cls(*values)
