"""The index of places answers as one sorted list of all entries does, however it grew."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from odom.frontend.features.place_descriptor import Place
from odom.frontend.matching import place_block
from odom.frontend.matching.place_block import PlaceBlock, first_at_least, keys_of, merged
from odom.frontend.matching.place_recognition import PlaceIndex
from odom.frontend.matching.tuning import TUNING

LOOKS = np.random.default_rng(0).integers(0, 256, (12, 32), dtype=np.uint8)
"""So few that most places share keys, and more of them than count for each."""


def place_of(descriptors):
    n = len(descriptors)
    return Place(descriptors, np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)))


def expected(held, asked, excluded, most):
    """What one list holds: for each key of each table the highest numbers, each a vote."""
    votes = Counter()
    keys = {number: keys_of(described) for number, described in held.items()}
    for table, own in enumerate(keys_of(asked).T):
        for key in own:
            numbers = sorted(n for n, of_place in keys.items() if key in of_place[:, table])
            votes.update(numbers[-TUNING.place_bucket :])
    ranked = sorted(votes, key=lambda n: (-votes[n], n))
    return [n for n in ranked if n not in excluded][:most]


chosen = st.lists(st.integers(0, len(LOOKS) - 1), max_size=4)


@given(
    st.lists(st.tuples(chosen, st.booleans()), max_size=90), chosen, st.sets(st.integers(0, 90), max_size=5),
    st.randoms(use_true_random=False),
)  # fmt: skip
def test_it_answers_as_one_list_does(places, asked, excluded, random):
    index, held = PlaceIndex(), {}
    for number, (looks, is_forgotten) in enumerate(places):
        held[number] = LOOKS[looks]
        index.adopt(index.grown({number: place_of(LOOKS[looks])}))
        if is_forgotten and len(held) > 2:
            index.forget(gone := random.choice(sorted(held)))
            del held[gone]
    found = index.look_up(place_of(LOOKS[asked]), excluded, 40)
    assert found == expected(held, LOOKS[asked], excluded, 40)


def test_it_can_be_asked_while_it_grows():
    index = PlaceIndex()
    index.adopt(index.grown({0: place_of(LOOKS[:3])}))
    grown = index.grown({1: place_of(LOOKS[:3])})
    assert index.look_up(place_of(LOOKS[:3]), set(), 5) == [0]
    index.adopt(grown)
    assert index.look_up(place_of(LOOKS[:3]), set(), 5) == [0, 1]


def test_places_of_a_block_are_left_out_as_if_they_had_never_been_in_it():
    described = [LOOKS[k : k + 3] for k in range(9)]
    block, gone = PlaceBlock.of(range(9), described).without({0, 4, 8}), {0, 4, 8}
    again = PlaceBlock.of([n for n in range(9) if n not in gone], [described[n] for n in range(9) if n not in gone])
    np.testing.assert_array_equal(block.numbers, again.numbers)
    for a, b in zip(block.tables, again.tables, strict=True):
        np.testing.assert_array_equal(a, b)


def test_an_entry_is_copied_a_few_times_however_many_places_there_are(monkeypatch):
    copied = 0

    def counted(a, b):
        nonlocal copied
        copied += len(a) + len(b)
        return merged(a, b)

    rng, index = np.random.default_rng(2), PlaceIndex()
    looks = rng.integers(0, 256, (1000, 10, 32), dtype=np.uint8)
    monkeypatch.setattr(place_block, "merged", counted)
    for number, look in enumerate(looks):
        index.adopt(index.grown({number: place_of(look)}))
    assert copied < 25 * looks.shape[0] * looks.shape[1] * 6


@pytest.mark.parametrize("kind", [np.uint32, np.int64])
@pytest.mark.parametrize("size", [0, 1, 2, 3, 7, 8, 9, 1000])
def test_a_search_in_step_finds_what_a_search_in_turn_does(kind, size):
    rng = np.random.default_rng(size)
    table, values = np.sort(rng.integers(0, 500, size).astype(kind)), rng.integers(-5, 510, 300)
    np.testing.assert_array_equal(first_at_least(table, values), np.searchsorted(table.astype(np.int64), values))
