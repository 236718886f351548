import itertools
import random
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from odom.frame import Stamp
from odom.wire.image_counts import BACKWARD, DUPLICATE, NO_COLOR, STRAY, ImageCounts
from odom.wire.pairing import LEAP_NS, Pair, Pairer

MS = 1_000_000
PERIOD = 33_333_333
Stamps = list[int]


def run(
    color: Stamps, depth: Stamps, order: random.Random | None = None, singles: bool = False
) -> tuple[list[tuple[int, int]], Pairer[int, int]]:
    """Feed two streams, merged by stamp or in a random interleaving that keeps each stream's order.

    Return the stamps of the pairs, and with `singles` also those of the colour images that came out alone.
    """
    pairer: Pairer[int, int] = Pairer()
    pairs: list[Pair[int, int]] = []
    i = j = 0
    while i < len(color) or j < len(depth):
        if order is None:
            take_color = j >= len(depth) or (i < len(color) and color[i] <= depth[j])
        elif abs(i - j) < 20:
            take_color = order.random() < 0.5
        else:
            take_color = i < j
        if (take_color and i < len(color)) or j >= len(depth):
            pairs += pairer.add_color(Stamp(color[i]), i)
            i += 1
        else:
            pairs += pairer.add_depth(Stamp(depth[j]), j)
            j += 1
    pairs += pairer.finish()
    return [(pair.color_stamp, pair.depth_stamp) for pair in pairs if singles or pair.depth is not None], pairer


@st.composite
def streams(draw: st.DrawFn) -> tuple[Stamps, Stamps]:
    """Two Kinect-like streams: 30 Hz, uneven by a few ms, an offset, and images missing."""
    count = draw(st.integers(1, 60))
    offset = draw(st.integers(-PERIOD, PERIOD))
    jitter = st.lists(st.integers(-3 * MS, 3 * MS), min_size=count, max_size=count)
    kept = st.lists(st.integers(0, 9), min_size=count, max_size=count)

    def stream(shift: int) -> Stamps:
        return [
            10**18 + i * PERIOD + shift + j
            for i, (j, k) in enumerate(zip(draw(jitter), draw(kept), strict=True))
            if k > 0
        ]

    return stream(0), stream(offset)


@given(streams(), st.integers(0, 2**32))
def test_outcome_does_not_depend_on_arrival(two: tuple[Stamps, Stamps], seed: int) -> None:
    by_stamp, _ = run(*two)
    shuffled, _ = run(*two, random.Random(seed))
    assert shuffled == by_stamp


@given(streams())
def test_pairs_are_one_to_one_in_order_and_within_reach(two: tuple[Stamps, Stamps]) -> None:
    pairs, pairer = run(*two)
    for earlier, later in itertools.pairwise(pairs):
        assert earlier[0] < later[0]
        assert earlier[1] < later[1]
    assert all(abs(c - d) <= (PERIOD + 7 * MS) / 2 for c, d in pairs)
    counters = pairer.counters
    assert counters.pairs + counters.color_single == len(two[0])
    assert counters.pairs + counters.depth.refused[NO_COLOR] == len(two[1])


@given(streams(), st.integers(0, 2**32))
def test_with_singles_every_colour_image_comes_out_once_in_order(two: tuple[Stamps, Stamps], seed: int) -> None:
    everything, _ = run(*two, random.Random(seed), singles=True)
    assert [color for color, _ in everything] == two[0]
    assert set(run(*two)[0]) <= set(everything)


@st.composite
def broken_streams(draw: st.DrawFn) -> tuple[Stamps, Stamps]:
    """Two streams with stamps that stand still, step back, stray, leap and go on from there."""

    def stream() -> Stamps:
        at, stamps = 10**18 + draw(st.integers(-PERIOD, PERIOD)), []
        for _ in range(draw(st.integers(0, 60))):
            fate = draw(st.sampled_from(["good"] * 6 + ["missing", "again", "back", "stray", "leap"]))
            step = draw(st.sampled_from([-5, -2, 2, 5])) * LEAP_NS
            at += PERIOD + (step if fate == "leap" else 0)
            if fate != "missing":
                stamps.append(at - {"again": PERIOD, "back": 3 * PERIOD, "stray": step}.get(fate, 0))
        return stamps

    return stream(), stream()


@given(broken_streams(), st.integers(0, 2**32))
def test_every_image_that_is_given_is_used_or_refused_for_a_reason(two: tuple[Stamps, Stamps], seed: int) -> None:
    found, pairer = run(*two, random.Random(seed), singles=True)
    counters = pairer.counters
    for counts, given_stamps in ((counters.color, two[0]), (counters.depth, two[1])):
        assert counts.given == len(given_stamps) == counts.used + counts.refused.total()
        assert min(counts.refused.values(), default=1) > 0
    assert counters.color.used == len(found)
    assert counters.depth.used == counters.pairs == len(found) - counters.color_single


@given(streams())
def test_no_two_would_rather_have_each_other(two: tuple[Stamps, Stamps]) -> None:
    pairs = run(*two)[0]
    for (c, d), (other_c, other_d) in itertools.combinations(pairs, 2):
        for color, depth in ((c, other_d), (other_c, d)):
            mine, theirs = abs(c - d), abs(other_c - other_d)
            assert abs(color - depth) >= min(mine, theirs)


@given(streams())
def test_no_regular_partner_is_missed(two: tuple[Stamps, Stamps]) -> None:
    """Whoever is mutually nearest, by a clear margin within half a period, is paired."""
    color, depth = two
    found = set(run(color, depth)[0])
    for c in color:
        d = min(depth, key=lambda other: abs(other - c), default=None)
        if d is not None and abs(c - d) < PERIOD / 2 - 5 * MS and min(color, key=lambda other: abs(other - d)) == c:
            assert (c, d) in found


def regular(count: int, begin: int = 10**18) -> Stamps:
    return [begin + i * PERIOD for i in range(count)]


def test_a_pair_of_regular_streams_is_certain_at_once() -> None:
    pairer: Pairer[int, int] = Pairer()
    for at in regular(20):
        assert pairer.add_color(Stamp(at), 0) == []
        assert len(pairer.add_depth(Stamp(at + 10 * MS), 0)) == 1


def test_duplicates_and_short_steps_back_are_dropped_and_counted() -> None:
    color = regular(10)
    bad = [*color[:5], color[4], color[2], *color[5:]]
    pairs, pairer = run(bad, regular(10))
    assert len(pairs) == 10
    assert pairer.counters.color == ImageCounts(12, 10, Counter({DUPLICATE: 1, BACKWARD: 1}))
    assert pairer.counters.depth == ImageCounts(10, 10)


@pytest.mark.parametrize("hours", [-1, 1])
def test_one_stray_stamp_costs_one_image(hours: int) -> None:
    color = regular(20)
    bad = [*color[:10], color[10] + hours * 3600 * LEAP_NS, *color[11:]]
    pairs, pairer = run(bad, regular(20))
    assert len(pairs) == 19
    assert pairer.counters.color.refused == {STRAY: 1}
    assert pairer.counters.leaps == 0


@pytest.mark.parametrize("hours", [-1, 1])
def test_both_clocks_leaping_is_followed_and_counted(hours: int) -> None:
    stamps = [*regular(20), *regular(20, 10**18 + hours * 3600 * LEAP_NS)]
    pairer: Pairer[int, int] = Pairer()
    pairs: list[Pair[int, int]] = []
    for at in stamps:
        pairs += pairer.add_color(Stamp(at), 0)
        pairs += pairer.add_depth(Stamp(at + 5 * MS), 0)
    pairs += pairer.finish()
    assert len(pairs) == 40
    assert pairer.counters.leaps == 2


def test_a_stream_that_stops_and_returns_goes_on() -> None:
    color, depth = regular(300), [*regular(100), *regular(300)[200:]]
    pairs, pairer = run(color, depth)
    assert len(pairs) == 200
    assert pairer.counters.color_single == 100


@given(st.lists(st.tuples(st.booleans(), st.integers(-(2**62), 2**62)), max_size=200))
def test_any_stamps_are_survived_within_bounds(events: list[tuple[bool, int]]) -> None:
    pairer: Pairer[int, int] = Pairer(capacity=4)
    for is_color, stamp in events:
        pairer.add_color(Stamp(stamp), 0) if is_color else pairer.add_depth(Stamp(stamp), 0)
        assert len(pairer._color.waiting) <= 4
        assert len(pairer._depth.waiting) <= 4
    pairer.finish()
