"""The index of places answers as one sorted list of all entries does, however it grew."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from odom.frontend.features.place_descriptor import Place
from odom.frontend.matching.place_block import PlaceBlock, first_at_least, keys_of
from odom.frontend.matching.place_recognition import PlaceIndex
from odom.frontend.matching.place_tables import PlaceTables
from odom.frontend.tuning import TUNING

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


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(chosen, st.booleans()), max_size=90), chosen, st.sets(st.integers(0, 90), max_size=5),
    st.randoms(use_true_random=False), st.booleans(),
)  # fmt: skip
def test_it_answers_as_one_list_does(places, asked, excluded, random, is_shuffled):
    numbers = list(range(len(places)))
    if is_shuffled:
        random.shuffle(numbers)
    index, held = PlaceIndex(), {}
    for number, (looks, is_forgotten) in zip(numbers, places, strict=True):
        held[number] = LOOKS[looks]
        index.add(number, place_of(LOOKS[looks]))
        if is_forgotten and len(held) > 2:
            index.forget(gone := random.choice(sorted(held)))
            del held[gone]
    found = index.look_up(place_of(LOOKS[asked]), excluded, 40)
    assert found == expected(held, LOOKS[asked], excluded, 40)


def test_blocks_and_tables_answer_alike():
    rng = np.random.default_rng(1)
    described = [LOOKS[rng.integers(0, len(LOOKS), 3)] for _ in range(100)]
    tables, block = PlaceTables(), PlaceBlock.of(range(100), described)
    for number, one in enumerate(described):
        tables.add(number, one)
    keys = keys_of(LOOKS)
    assert sorted(tables.voted(keys)) == sorted(block.voted(keys))


def test_an_entry_is_copied_a_few_times_however_many_places_there_are(monkeypatch):
    copied = 0
    sort = np.sort

    def counted(entries, **how):
        nonlocal copied
        copied += len(entries)
        return sort(entries, **how)

    rng, tables = np.random.default_rng(2), PlaceTables()
    looks = rng.integers(0, 256, (2000, 10, 32), dtype=np.uint8)
    monkeypatch.setattr(np, "sort", counted)
    for number, look in enumerate(looks):
        tables.add(number, look)
    assert copied < 25 * looks.shape[0] * looks.shape[1] * 6


@pytest.mark.parametrize("kind", [np.uint32, np.int64])
@pytest.mark.parametrize("size", [0, 1, 2, 3, 7, 8, 9, 1000])
def test_a_search_in_step_finds_what_a_search_in_turn_does(kind, size):
    rng = np.random.default_rng(size)
    table, values = np.sort(rng.integers(0, 500, size).astype(kind)), rng.integers(-5, 510, 300)
    np.testing.assert_array_equal(first_at_least(table, values), np.searchsorted(table.astype(np.int64), values))
