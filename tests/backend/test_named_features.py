"""Features of two frames are matched by name, whatever has been culled in between."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from odom.backend.chain.named_features import NamedFeatures
from odom.frontend.features.measurement import Measurements


def features(identities: list[int]) -> NamedFeatures:
    """The features of a frame whose landmarks have these identities; 0 are those culled since it was tracked."""
    n = len(identities)
    measured = Measurements(np.arange(3.0 * n).reshape(n, 3), np.zeros((n, 3, 3)), np.zeros((n, 4)), np.zeros((n, 2)))
    tracked = SimpleNamespace(uv=np.zeros((n, 2)), measurements=measured)
    return NamedFeatures.of(cast(Any, tracked), np.array(identities, dtype=np.int64))


unique = st.lists(st.integers(1, 30), unique=True, max_size=20)


@given(before=unique, now=unique, culled_before=st.integers(0, 5), culled=st.integers(0, 5))
def test_what_both_measured_is_found_beside_any_number_of_culled_landmarks(before, now, culled_before, culled):
    earlier, later = features([0] * culled_before + before), features(now + [0] * culled)
    here, there = earlier.in_common_with(later)
    np.testing.assert_array_equal(here.names, there.names)
    assert set(here.names.tolist()) == set(before) & set(now)
    assert len(here.measured) == len(there.measured) == len(here.uv)
