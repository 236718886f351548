"""Blocks of the inverse of a large sparse symmetric matrix, from its Cholesky factor, without the rest of the inverse.

Those where the factor has blocks follow from each other, from the last column to the first (K. Takahashi, J. Fagan and
M. Chin, "Formation of a sparse bus impedance matrix", 1973): with A = L L' and Z = inv(A), Z L = inv(L)'.
"""

import numpy as np

from odom.backend.map.block_cholesky import find_block
from odom.geometry.arrays import Array, Index
from odom.geometry.compiled import compiled


@compiled
def inverse_blocks(start: Index, row: Index, L: Array) -> Array:
    """Return the blocks of the inverse (as many as `L`, x 6 x 6) where a factor `L` has blocks (see `BlockPattern`)."""
    Z = np.zeros_like(L)
    inverse, total = np.zeros((6, 6)), np.zeros((6, 6))
    for j in range(len(start) - 2, -1, -1):
        first, stop = start[j], start[j + 1]
        _invert_triangle(L[first], inverse)
        for p in range(stop - 1, first - 1, -1):
            for i in range(6):
                for k in range(6):
                    total[i, k] = inverse[k, i] if p == first else 0.0
            for q in range(first + 1, stop):
                low, high = min(row[p], row[q]), max(row[p], row[q])
                at = find_block(start, row, low, high)
                is_turned = row[p] < row[q]
                for i in range(6):
                    for k in range(6):
                        product = 0.0
                        for c in range(6):
                            product += (Z[at, c, i] if is_turned else Z[at, i, c]) * L[q, c, k]
                        total[i, k] -= product
            for i in range(6):
                for k in range(6):
                    product = 0.0
                    for c in range(6):
                        product += total[i, c] * inverse[c, k]
                    Z[p, i, k] = product
    return Z


@compiled
def _invert_triangle(D: Array, out: Array) -> None:
    """Set `out` to the inverse of a lower triangle (6 x 6)."""
    for k in range(6):
        for i in range(6):
            rest = 1.0 if i == k else 0.0
            for c in range(k, i):
                rest -= D[i, c] * out[c, k]
            out[i, k] = rest / D[i, i] if i >= k else 0.0
