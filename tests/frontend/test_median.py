"""The median inside compiled loops is numpy's, to the bit."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from odom.frontend.features.depth_plane import median_of


@given(
    values=st.integers(1, 49).flatmap(lambda n: arrays(float, n, elements=st.floats(0.01, 20.0))),
    spare=st.integers(0, 5),
)
def test_the_median_is_numpys_and_the_values_stay_as_they_are(values, spare):
    longer = np.concatenate([values, np.full(spare, -1.0)])
    before = longer.copy()
    assert median_of(longer, len(values), np.empty(len(longer))) == np.median(values)
    np.testing.assert_array_equal(longer, before)
