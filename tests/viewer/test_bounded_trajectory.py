from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from odom.evaluation import Trajectory
from odom.frame import Stamp
from odom.viewer.bounded_trajectory import BoundedTrajectory
from odom.viewer.line_strips import dashes, lines


def _pose(i: int) -> np.ndarray:
    T = np.eye(4)
    T[0, 3] = i
    return T


@given(count=st.integers(0, 3000), limit=st.integers(8, 200))
def test_stays_bounded_increasing_and_ends_with_the_newest(count: int, limit: int) -> None:
    trail = BoundedTrajectory(limit)
    for i in range(count):
        trail.add(Stamp(10 * i), _pose(i))
    kept = trail.trajectory()  # raises when stamps do not increase
    assert len(kept) <= limit + 1
    assert len(kept) == count or len(kept) > limit // 2
    if count:
        assert trail.newest == 10 * (count - 1)
        assert kept.stamps[-1] == trail.newest
        assert kept.stamps[0] == 0
        assert (kept.positions[:, 0] * 10 == kept.stamps).all()


@given(count=st.integers(100, 3000))
def test_thinned_evenly(count: int) -> None:
    trail = BoundedTrajectory(64)
    for i in range(count):
        trail.add(Stamp(i), _pose(i))
    gaps = np.diff(trail.trajectory().stamps)[:-1]
    assert gaps.max() <= 2 * gaps.min()


def test_a_pose_that_is_not_newer_is_ignored() -> None:
    trail = BoundedTrajectory(8)
    for stamp in (5, 5, 3, 6):
        trail.add(Stamp(stamp), _pose(stamp))
    assert trail.trajectory().stamps.tolist() == [5, 6]


@pytest.mark.parametrize("step_ms", [33, 500])
def test_a_gap_is_never_bridged_by_a_line_and_the_steps_of_slow_streams_are(step_ms: int) -> None:
    trail = BoundedTrajectory(64)
    begun = [trail.add(Stamp(1_000_000 * (step_ms * i + 10_000 * (i >= 500))), _pose(i)) for i in range(1000)]
    assert [i for i, begins_strip in enumerate(begun) if begins_strip] == [500]
    parts = lines(trail.trajectory().positions, trail.strips())
    assert len(parts) == 2
    assert parts[0][-1, 0] < 500 <= parts[1][0, 0]


@pytest.mark.parametrize(
    ("at_ms", "begun"),
    [
        ((0, 33, 66, 9000, 19_000, 19_033), (3, 4)),
        ((0, 60_000, 60_033, 60_066), (1,)),
        ((0, 33, 66, 99, 600, 1100, 1600, 2100), (4, 5)),
        ((0, 2000, 4000), ()),
    ],
    ids=["a lone pose between two gaps", "a gap at once", "a stream that slows down", "a slow stream"],
)
def test_a_new_strip_begins_behind_each_gap(at_ms: tuple[int, ...], begun: tuple[int, ...]) -> None:
    trail = BoundedTrajectory(64)
    found = [trail.add(Stamp(1_000_000 * at), _pose(at)) for at in at_ms]
    assert [i for i, begins_strip in enumerate(found) if begins_strip] == list(begun)


def test_a_gap_between_the_history_and_now_is_never_bridged_by_a_line() -> None:
    trail, stamps = BoundedTrajectory(64), 33_000_000 * np.arange(10)
    trail.prepend(Trajectory(stamps, np.array([_pose(i) for i in range(10)])))
    assert not trail.add(Stamp(int(stamps[-1]) + 33_000_000), _pose(10))
    assert trail.add(Stamp(int(stamps[-1]) + 4_000_000_000), _pose(11))


@given(earlier=st.integers(0, 500), later=st.integers(0, 300))
def test_history_is_put_before_what_is_known(earlier: int, later: int) -> None:
    trail = BoundedTrajectory(100)
    for i in range(later):
        trail.add(Stamp(400 + i), _pose(400 + i))
    stamps = np.arange(earlier, dtype=np.int64)
    trail.prepend(Trajectory(stamps, np.array([_pose(i) for i in range(earlier)]).reshape(-1, 4, 4)))
    kept = trail.trajectory()
    assert len(kept) <= 101
    if later:
        assert kept.stamps[-1] == 400 + later - 1
    if earlier:
        assert kept.stamps[0] == 0


@pytest.mark.parametrize("step_ms", [33, 1000])
def test_a_gap_in_the_history_is_never_bridged_by_a_line(step_ms: int) -> None:
    """A history of hours is thinned out: its steps are longer than what interrupts one that is whole."""
    stamps = np.arange(90, dtype=np.int64) * step_ms * 1_000_000
    stamps[30:] += 10_000_000_000
    trail = BoundedTrajectory(200)
    trail.add(Stamp(int(stamps[-1]) + 1), _pose(90))
    trail.prepend(Trajectory(stamps, np.array([_pose(i) for i in range(90)])))
    parts = lines(trail.trajectory().positions, trail.strips())
    assert [(part[0, 0], part[-1, 0]) for part in parts] == [(0, 29), (30, 89)]


@given(points=st.integers(2, 60), step=st.floats(0.01, 3.0))
def test_dashes_of_two_phases_never_cover_each_other_and_lie_on_the_line(points: int, step: float) -> None:
    line = [np.array([[step * i, 0.0, 0.0] for i in range(points)], dtype=np.float32)]
    covered = [dashes(line, phase) for phase in range(3)]
    spans = sorted((float(piece[0, 0]), float(piece[-1, 0])) for pieces in covered for piece in pieces)
    assert spans[0][0] == 0.0
    assert abs(spans[-1][1] - line[0][-1, 0]) < 1e-3
    assert all(abs(end - begin) < 1e-3 for (_, end), (begin, _) in pairwise(spans))
    assert max(len(pieces) for pieces in covered) <= 1501


@pytest.mark.parametrize("extent_m", [0.5, 3.0, 12.0, 80.0])
def test_a_dash_can_be_seen_where_the_whole_way_fills_the_view(extent_m: float) -> None:
    way = np.zeros((400, 3), dtype=np.float32)
    way[:, 0] = extent_m * np.abs(np.linspace(-1.0, 1.0, 400))
    dash = dashes([way], 0)[0]
    length = float(np.linalg.norm(dash[-1] - dash[0]))
    assert length > extent_m / 70
    assert length < max(0.051, extent_m / 30)
