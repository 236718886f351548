"""The pattern of sparse factors: it holds every block that elimination fills, however long the walk."""

import numpy as np
import pytest

from odom.backend.map.block_cholesky import BlockPattern


def filled(pattern, a, b):
    """How many blocks elimination fills in a factor, in the order of a pattern, by sets."""
    n = len(pattern.place)
    below = [set() for _ in range(n)]
    first, second = pattern.place[a], pattern.place[b]
    for column, row in zip(np.minimum(first, second).tolist(), np.maximum(first, second).tolist(), strict=True):
        below[column].add(row)
    for column in below:
        if column:
            below[min(column)] |= column - {min(column)}
    return n + sum(len(column) for column in below)


@pytest.mark.parametrize("poses", [10, 1000, 10_000])
@pytest.mark.parametrize("closures", [1, 5, 30])
def test_no_block_is_missing_of_a_walk_that_ends_where_it_began(poses, closures):
    closures = min(closures, poses // 3)
    a = np.concatenate([np.arange(poses - 1), np.arange(closures)])
    b = np.concatenate([np.arange(1, poses), poses - 1 - np.arange(closures)])
    pattern = BlockPattern.of(poses, a, b)
    assert len(pattern.row) == filled(pattern, a, b)
    column, row = np.sort([pattern.place[a], pattern.place[b]], axis=0)
    np.testing.assert_array_equal(pattern.row[pattern.slot], row)
    assert (pattern.start[column] < pattern.slot).all()
    assert (pattern.slot < pattern.start[column + 1]).all()
