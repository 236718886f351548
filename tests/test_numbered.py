import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from odom.geometry.numbered import distinct, places_of, shared

NUMBERS = st.lists(st.integers(-(2**40), 2**40) | st.integers(-50, 50), unique=True, max_size=60)


@given(NUMBERS, NUMBERS)
def test_numbers_are_found_as_by_numpy(first: list[int], second: list[int]) -> None:
    a, b = np.array(first, dtype=np.int64), np.array(second, dtype=np.int64)
    places = places_of(a, b)
    assert np.array_equal(places >= 0, np.isin(a, b))
    assert np.array_equal(b[places[places >= 0]], a[places >= 0])
    _, here, there = np.intersect1d(a, b, assume_unique=True, return_indices=True)
    assert all(np.array_equal(x, y) for x, y in zip(shared(a, b), (here, there), strict=True))


@given(st.lists(st.integers(0, 500), max_size=60))
def test_which_small_numbers_there_are_is_found_as_by_numpy(numbers: list[int]) -> None:
    a = np.array(numbers, dtype=np.int64)
    assert np.array_equal(distinct(a), np.unique(a))
