"""Registrations as arrays, kept up to date beside the graph, so that all of them can be copied quickly."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from odom.backend.map.pose_graph import Edge, EdgeArrays

_FIRST_ROWS = 256
"""Rows allocated at first, some .2 MB."""


class EdgeTable:
    """One row for each registration, by its two key frames; rows of those that are dropped are used again."""

    def __init__(self) -> None:
        self._fields = _allocated(_FIRST_ROWS)
        self._row: dict[tuple[int, int], int] = {}
        self._free: list[int] = []

    def put(self, edge: Edge) -> None:
        """Add a registration, or replace the one between the same key frames."""
        pair = min(edge.a, edge.b), max(edge.a, edge.b)
        row = self._row.get(pair)
        if row is None:
            row = self._row[pair] = self._free.pop() if self._free else len(self._row)
            if row == len(self._fields["a"]):
                more = _allocated(row)
                self._fields = {name: np.concatenate([old, more[name]]) for name, old in self._fields.items()}
        f = self._fields
        f["a"][row], f["b"][row], f["T_a_b"][row], f["is_loop"][row] = edge.a, edge.b, edge.T_a_b, edge.is_loop
        f["covariance"][row] = edge.covariance

    def drop(self, a: int, b: int) -> None:
        """Remove the registration between two key frames."""
        row = self._row.pop((min(a, b), max(a, b)))
        self._fields["a"][row] = self._fields["b"][row] = -1
        self._free.append(row)

    def among(self, is_member: NDArray[np.bool_]) -> EdgeArrays:
        """Return a copy of the registrations between any two of the key frames marked (by number)."""
        a, b = self._fields["a"], self._fields["b"]
        rows = np.flatnonzero(a >= 0)
        rows = rows[is_member[a[rows]] & is_member[b[rows]]]
        return EdgeArrays(**{name: values[rows] for name, values in self._fields.items()})


def _allocated(rows: int) -> dict[str, NDArray[Any]]:
    return {
        "a": np.full(rows, -1, dtype=np.int64),
        "b": np.full(rows, -1, dtype=np.int64),
        "T_a_b": np.zeros((rows, 4, 4)),
        "covariance": np.zeros((rows, 6, 6)),
        "is_loop": np.zeros(rows, dtype=np.bool_),
    }
