"""The nearest of some points, against all distances put in order."""

import numpy as np
import pytest

from odom.geometry.neighbours import nearest


@pytest.mark.parametrize(("n", "m", "count"), [(1, 1, 1), (5, 3, 3), (0, 4, 2), (50, 64, 1), (200, 300, 12)])
@pytest.mark.parametrize("size_m", [1e-3, 1.0, 1e3])
def test_the_nearest_are_those_of_all_distances_in_order(n: int, m: int, count: int, size_m: float) -> None:
    rng = np.random.default_rng(0)
    points, among = size_m * rng.normal(size=(n, 3)), size_m * rng.normal(size=(m, 3))
    among[m // 3 : m // 2] = among[0]  # several in one place: the first in number comes first
    away2 = np.square(points[:, None] - among[None]).sum(axis=2)
    near, within2 = nearest(points, among, count)
    order = np.argsort(away2, axis=1, kind="stable")[:, :count]
    np.testing.assert_array_equal(near, order)
    np.testing.assert_allclose(within2, np.take_along_axis(away2, order, 1)[:, -1], rtol=1e-12)


def test_points_that_are_nowhere_leave_the_others_as_they_are() -> None:
    points = np.random.default_rng(0).normal(size=(20, 3))
    expected, _ = nearest(points, points, 4)
    with_holes = np.vstack([points[:10], np.full((1, 3), np.nan), points[10:]])
    near, _ = nearest(with_holes, points, 4)
    np.testing.assert_array_equal(np.delete(near, 10, axis=0), expected)
    assert near.min() >= 0
