"""The nearest of a few points are those that sorting all distances gives."""

import numpy as np
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
