"""The nearest of a few points are those that sorting all distances gives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from odom.geometry.neighbours import nearest


@given(st.integers(1, 40), st.integers(1, 60), st.integers(1, 12), st.integers(0, 1000))
def test_they_are_those_of_all_distances_in_order(n, m, count, seed):
    rng = np.random.default_rng(seed)
    points, among = rng.normal(size=(n, 3)), rng.normal(size=(m, 3))
    count = min(count, m)
    near, within2 = nearest(points, among, count)
    away2 = ((points[:, None] - among) ** 2).sum(axis=2)
    np.testing.assert_array_equal(near, np.argsort(away2, axis=1)[:, :count])
    np.testing.assert_allclose(within2, np.sort(away2, axis=1)[:, count - 1])


@pytest.mark.parametrize("size_m", [1e-3, 1.0, 1e3])
def test_of_several_in_one_place_the_first_in_number_comes_first(size_m):
    rng = np.random.default_rng(0)
    points, among = size_m * rng.normal(size=(200, 3)), size_m * rng.normal(size=(300, 3))
    among[100:150] = among[0]
    near, _ = nearest(points, among, 12)
    away2 = ((points[:, None] - among) ** 2).sum(axis=2)
    np.testing.assert_array_equal(near, np.argsort(away2, axis=1, kind="stable")[:, :12])


def test_points_that_are_nowhere_leave_the_others_as_they_are():
    points = np.random.default_rng(0).normal(size=(20, 3))
    expected, _ = nearest(points, points, 4)
    near, _ = nearest(np.insert(points, 10, np.nan, axis=0), points, 4)
    np.testing.assert_array_equal(np.delete(near, 10, axis=0), expected)
