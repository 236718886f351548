"""Cholesky factors of large sparse symmetric matrices of 6 x 6 blocks, one row and column of blocks for each pose.

The factor's pattern follows from which poses have a common block (T. Davis, "Direct methods for sparse linear systems",
2006, chapter 4): it is found once, by scipy, on a matrix of one number for each block. The blocks are eliminated in the
order of least fill (SuperLU's minimum degree). All loops run without the GIL, so that frames need not wait for them.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

from odom.geometry.arrays import Array, Index, Mask
from odom.geometry.compiled import compiled

_LEAST_WEIGHT = 1e-9
"""What the matrix of one number a block has on its diagonal beside a pose's number of blocks. So small that the factor
keeps each of its numbers: those of a graph's Laplacian are of one sign, and fall with the number of poses. With a
larger one they fall exponentially along a chain, some become 0, and scipy leaves them out of the pattern."""


@dataclass(frozen=True, eq=False)
class BlockPattern:
    """Where the factor of an n x n matrix of blocks has blocks: `row` is that of each, ascending in each column.

    Column j begins at `start[j]` (n + 1) with the block on the diagonal. `place` (n) is a pose's row and column in the
    factor, after reordering. `slot` (m) is where each off-diagonal block goes that the pattern was made of, and
    `is_turned` (m) whether it is transposed there.
    """

    place: Index
    start: Index
    row: Index
    slot: Index
    is_turned: Mask

    @classmethod
    def of(cls, n: int, a: Index, b: Index) -> "BlockPattern":
        """Return the pattern of a matrix with blocks on the diagonal and in rows `a` (m), columns `b`, and (b, a)."""
        weight = -np.ones(len(a))
        diagonal = np.bincount(a, minlength=n) + np.bincount(b, minlength=n) + _LEAST_WEIGHT
        entries = np.concatenate([weight, weight, diagonal])
        every = np.arange(n)
        at = np.concatenate([a, b, every]), np.concatenate([b, a, every])
        factors = splu(
            coo_matrix((entries, at), shape=(n, n)).tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        lower = factors.L
        lower.sort_indices()
        place = factors.perm_c.astype(np.int64)
        start, row = lower.indptr.astype(np.int64), lower.indices.astype(np.int64)
        first, second = place[a], place[b]
        column, below = np.minimum(first, second), np.maximum(first, second)
        slot = _slots(start, row, column, below)
        return cls(place, start, row, slot, first < second)


@compiled
def find_block(start: Index, row: Index, column: int, below: int) -> int:
    """Return where the block of a `column` and the row `below` is, by bisection."""
    low, high = start[column], start[column + 1] - 1
    while low < high:
        middle = (low + high) // 2
        if row[middle] < below:
            low = middle + 1
        else:
            high = middle
    return int(low)


@compiled
def _slots(start: Index, row: Index, column: Index, below: Index) -> Index:
    """Return where the blocks of each `column` and the row `below` (m) are."""
    out = np.empty(len(column), np.int64)
    for e in range(len(column)):
        out[e] = find_block(start, row, column[e], below[e])
    return out


@compiled
def factorise(start: Index, row: Index, L: Array) -> bool:
    """Turn the lower triangle `L` (blocks x 6 x 6, by the pattern) into its Cholesky factor; False where it has none.

    Right-looking: column by column, blocks are divided by the factor of the diagonal one, and their products are
    subtracted from the columns of their rows.
    """
    for j in range(len(start) - 1):
        first, stop = start[j], start[j + 1]
        # the block on the diagonal: D <- chol(D)
        D = L[first]
        for i in range(6):
            for k in range(i + 1):
                rest = D[i, k]
                for c in range(k):
                    rest -= D[i, c] * D[k, c]
                if i > k:
                    D[i, k] = rest / D[k, k]
                elif rest > 0.0:
                    D[i, i] = math.sqrt(rest)
                else:
                    return False
        # the blocks below: B <- B inv(D)'
        for p in range(first + 1, stop):
            B = L[p]
            for i in range(6):
                for k in range(6):
                    rest = B[i, k]
                    for c in range(k):
                        rest -= B[i, c] * D[k, c]
                    B[i, k] = rest / D[k, k]
        # later columns: L[row q, column p] -= B_q B_p'
        for p in range(first + 1, stop):
            at = start[row[p]]
            for q in range(p, stop):
                while row[at] < row[q]:
                    at += 1
                for i in range(6):
                    for k in range(6):
                        product = 0.0
                        for c in range(6):
                            product += L[q, i, c] * L[p, k, c]
                        L[at, i, k] -= product
    return True


@compiled
def solve(start: Index, row: Index, L: Array, x: Array) -> None:
    """Replace `x` (n x 6, reordered) by the solution of `L L' y = x`."""
    n = len(start) - 1
    for j in range(n):
        D = L[start[j]]
        for i in range(6):
            for c in range(i):
                x[j, i] -= D[i, c] * x[j, c]
            x[j, i] /= D[i, i]
        for p in range(start[j] + 1, start[j + 1]):
            for i in range(6):
                for c in range(6):
                    x[row[p], i] -= L[p, i, c] * x[j, c]
    for j in range(n - 1, -1, -1):
        D = L[start[j]]
        for p in range(start[j] + 1, start[j + 1]):
            for i in range(6):
                for c in range(6):
                    x[j, i] -= L[p, c, i] * x[row[p], c]
        for i in range(5, -1, -1):
            for c in range(i + 1, 6):
                x[j, i] -= D[c, i] * x[j, c]
            x[j, i] /= D[i, i]
