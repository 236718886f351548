"""A map with a bound: what is forgotten, what stays right, and a walk round a room that never notices."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_scene import chain_of_keyframes
from painted_room import PERIOD, SMALL, START, PaintedRoom
from rounds import ROUND, round_and_more, turned
from running import Ran, check_sanity, numbers
from sensor_models import sensor_model

from odom.backend import Odometry, OdometrySettings, State
from odom.backend.loop_closure.closing import close_loops, merge_segment
from odom.backend.loop_closure.graph import SegmentGraph
from odom.backend.loop_closure.verification import contradiction
from odom.backend.map.pose_graph import Edge
from odom.backend.map.pruning import forget, oldest_beyond
from odom.backend.mapping.map_adjustment import _oldest_connected
from odom.backend.mapping.observations import Observations, gather_observations
from odom.evaluation.trajectory import Trajectory
from odom.frame import RgbdFrame, Stamp
from odom.frontend.features.place_descriptor import Place
from odom.frontend.matching.place_recognition import PlaceIndex
from odom.geometry import se3

COVARIANCE = np.diag([1e-4, 2e-4, 3e-4, 1e-5, 2e-5, 3e-5])
FRAMES = 360
MOST = 10


def way(count):
    """Key frames on a winding way."""
    step = se3.exp(np.array([0.1, 0.02, 0.3, 0.05, 0.2, -0.03]))
    out = [np.eye(4)]
    while len(out) < count:
        out.append(out[-1] @ step)
    return out


def relative(map_, a, b):
    return map_.keyframes[a].T_camera_map @ se3.inverse(map_.keyframes[b].T_camera_map)


def test_the_oldest_go_first_and_never_those_needed():
    map_ = chain_of_keyframes(way(8), COVARIANCE)
    assert oldest_beyond(map_, 8, np.array([0])) == []
    assert oldest_beyond(map_, 6, np.array([0, 2])) == [1, 3]
    assert oldest_beyond(map_, 2, np.array([0, 2, 4, 5, 6, 7])) == [1, 3]


def test_a_forgotten_key_frame_keeps_its_pose_and_nothing_that_it_measured():
    map_ = chain_of_keyframes(way(6), COVARIANCE)
    poses = [k.T_camera_map.copy() for k in map_.keyframes]
    forget(map_, 2)
    assert map_.remembered == [0, 1, 3, 4, 5]
    L = map_.landmarks
    assert not (L.keyframe[L.alive] == 2).any()
    assert (np.bincount(L.keyframe[L.alive], minlength=6) == [20, 20, 0, 20, 20, 20]).all()
    forgotten = map_.keyframes[2]
    assert len(forgotten.rows) == len(forgotten.identities) == len(forgotten.uv) == len(forgotten.measurements) == 0
    twice, _ = gather_observations(2 * map_.keyframes, np.array(2 * poses), L, sensor_model(SMALL), least=1)
    assert (np.bincount(twice.keyframe, minlength=12) == 2 * [20, 20, 0, 20, 20, 20]).all()
    assert not map_.links[2]
    assert not any(2 in links for links in map_.links)
    for keyframe, before in zip(map_.keyframes, poses, strict=True):
        np.testing.assert_array_equal(keyframe.T_camera_map, before)


def test_what_is_left_stays_linked_and_registered():
    map_ = chain_of_keyframes(way(9), COVARIANCE)
    for number in (0, 4, 3, 7, 5):
        forget(map_, number)
        assert len(map_.registrations.among(set(map_.remembered))) == len(map_.remembered) - 1
        linked, registered = {map_.remembered[0]}, {map_.remembered[0]}
        for _ in range(9):
            linked |= set().union(*(map_.links[n] for n in linked))
            registered |= {edge.b for n in registered for edge in map_.registrations.of(n)}
        assert linked == registered == set(map_.remembered)


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1), (2, 4, 1, 3), (5, 0, 4)])
def test_covariances_along_a_chain_are_the_same_without_what_is_forgotten(order):
    whole, map_ = (chain_of_keyframes(way(8), COVARIANCE) for _ in range(2))
    for number in order:
        forget(map_, number)
    for a in range(8):
        for b in map_.remembered:
            before, after = (m.registrations.covariance_between(a, b) for m in (whole, map_))
            if a in map_.remembered:
                np.testing.assert_allclose(after, before, rtol=1e-9, atol=1e-15)
            else:
                assert np.linalg.eigvalsh(after - before)[0] > -1e-12


def test_branches_at_a_forgotten_key_frame_are_never_surer_of_each_other():
    whole, map_ = (chain_of_keyframes(way(6), COVARIANCE, begins=(0, 2, 3, 4, 5)) for _ in range(2))
    for m in (whole, map_):
        for k in (2, 3, 4, 5):
            m.register(Edge(1, k, relative(m, 1, k), COVARIANCE))
    forget(map_, 1)
    for a in map_.remembered:
        for b in map_.remembered:
            before, after = (m.registrations.covariance_between(a, b) for m in (whole, map_))
            assert np.linalg.eigvalsh(after - before)[0] > -1e-12


def test_the_forgotten_follow_what_is_nearest_and_the_past_stays_when_a_loop_is_closed():
    true = way(12)
    map_ = chain_of_keyframes(true, COVARIANCE)
    for number in (0, 1, 2, 7):
        forget(map_, number)
    assert {h: sorted(f) for h, f in map_.followers.items()} in ({3: [0, 1, 2], 6: [7]}, {3: [0, 1, 2], 8: [7]})
    heir = next(h for h, f in map_.followers.items() if 7 in f)
    past = [map_.keyframes[k].T_camera_map.copy() for k in range(4)]
    before = relative(map_, heir, 7)
    off = se3.exp(np.array([0.1, -0.05, 0.08, 0.0, 0.02, 0.0]))
    close_loops(map_, [Edge(3, 11, se3.inverse(true[3]) @ true[11] @ off, COVARIANCE * 0.01, True)])
    assert np.linalg.norm(se3.log(relative(map_, 3, 11) @ se3.inverse(se3.inverse(true[3]) @ true[11]))) > 0.05
    np.testing.assert_allclose(relative(map_, heir, 7), before, atol=1e-9)
    for k in range(4):
        np.testing.assert_allclose(map_.keyframes[k].T_camera_map, past[k], atol=1e-5)


def test_the_last_that_a_segment_has_left_is_forgotten_and_stays_where_it_is_with_what_followed_it():
    map_ = chain_of_keyframes(way(6), COVARIANCE, begins=(0, 3))
    poses = [k.T_camera_map.copy() for k in map_.keyframes]
    for number in (0, 1, 2):
        forget(map_, number)
    assert map_.remembered == [3, 4, 5]
    assert map_.followers == {}
    for k, before in zip(map_.keyframes, poses, strict=True):
        np.testing.assert_array_equal(k.T_camera_map, before)


def test_a_loop_to_what_was_forgotten_is_refused_in_these_words():
    map_ = chain_of_keyframes(way(6), COVARIANCE)
    forget(map_, 2)
    closure = Edge(2, 5, relative(map_, 2, 5), COVARIANCE, is_loop=True)
    assert "no longer in this part" in contradiction(SegmentGraph.of(map_, 0), closure, 0.0)


def test_a_segment_that_is_merged_takes_what_it_has_forgotten_with_it():
    map_ = chain_of_keyframes(way(8), COVARIANCE, begins=(0, 4))
    forget(map_, 4)
    forget(map_, 5)
    poses = [k.T_camera_map.copy() for k in map_.keyframes]
    T_new_old = se3.exp(np.array([1.0, -2.0, 0.5, 0.4, -1.0, 0.3]))
    T_2_7 = map_.keyframes[2].T_camera_map @ T_new_old @ se3.inverse(map_.keyframes[7].T_camera_map)
    merge_segment(map_, Edge(2, 7, T_2_7, COVARIANCE))
    assert {k.segment for k in map_.keyframes} == {0}
    for k, before in zip(map_.keyframes, poses, strict=True):
        expected = before if k.number < 4 else before @ se3.inverse(T_new_old)
        np.testing.assert_allclose(k.T_camera_map, expected, atol=1e-9)


def test_a_forgotten_place_is_not_found_and_leaves_nothing_in_the_index():
    rng, index = np.random.default_rng(0), PlaceIndex()
    looks = rng.integers(0, 256, (5, 200, 32), dtype=np.uint8)
    places = [Place(look, np.zeros((200, 3)), np.tile(np.eye(3), (200, 1, 1))) for look in looks]
    for number, place in enumerate(places):
        index.adopt(index.grown({number: place}))
    assert index.look_up(places[3], set(), 1) == [3]
    index.forget(3)
    index.forget(3)
    assert 3 not in index.look_up(places[3], set(), 5)
    assert index.look_up(places[4], set(), 1) == [4]
    for number in (0, 1, 2, 4):
        index.forget(number)
    assert not index.places
    assert not index.grown({}).blocks


def test_parts_that_no_landmark_joins_any_more_are_each_held():
    keyframe, landmark = np.array([[0, 0], [2, 0], [1, 1], [3, 1], [3, 2], [4, 2]]).T
    nothing = np.zeros((6, 3))
    observations = Observations(keyframe, landmark, nothing, np.zeros((6, 3, 3)), np.zeros((6, 4)))
    np.testing.assert_array_equal(_oldest_connected(observations, 6), [0, 1, 0, 1, 1, 5])


@pytest.fixture(scope="module")
def rounds() -> list[RgbdFrame]:
    """Two rounds and a quarter in a room."""
    return round_and_more(FRAMES)


@pytest.fixture(scope="module")
def truth(rounds) -> Trajectory:
    return Trajectory(np.array([f.stamp for f in rounds]), np.array([turned(k) for k in range(FRAMES)]))


def ran_with(most, frames, anticipates=False):
    """The run, and after each frame how many key frames are remembered, landmarks alive and places known."""
    odometry, estimates, sizes = Odometry(SMALL, OdometrySettings(map_keyframes=most)), [], []
    for frame in frames:
        if anticipates:
            odometry.anticipate(frame.stamp, frame.color)
        estimates.append(odometry.process(frame))
        map_ = odometry._stages.map
        sizes.append((len(map_.remembered), int(map_.landmarks.alive.sum()), len(map_.places.places)))
    ran = Ran(tuple(estimates), odometry.finish(), odometry.timing)
    return ran, np.array(sizes), odometry


@pytest.fixture(scope="module")
def forgetful(rounds):
    return ran_with(MOST, rounds)


def test_a_walk_through_more_places_than_are_remembered_stays_tracked_and_right(forgetful, rounds, truth):
    ran, _, odometry = forgetful
    check_sanity(ran)
    assert set(ran.states) == {State.TRACKING}
    assert odometry.forgotten_keyframes > 2 * MOST
    report = ran.judged(truth)
    assert report.matched == len(rounds)
    assert report.ate_m < 0.005
    for relative in (e.second for e in ran.estimates[60:]):
        assert np.sqrt(np.diag(relative.covariance)).max() < 0.05


def test_its_map_stays_within_the_bound(forgetful):
    _, sizes, odometry = forgetful
    keyframes, landmarks, places = sizes.T
    assert keyframes.max() <= MOST + 2  # while the background works
    assert places.max() <= MOST
    assert landmarks[FRAMES // 2 :].max() < 1.2 * landmarks[: FRAMES // 2].max()
    kept = odometry._stages.map
    assert all(len(k.rows) == 0 for k in kept.keyframes if k.number not in kept.remembered)
    assert sum(len(f) for f in kept.followers.values()) == odometry.forgotten_keyframes


def test_its_path_shows_every_key_frame_still(forgetful):
    ran, _, odometry = forgetful
    last = next(e for e in reversed(ran.estimates) if e.path is not None)
    assert len(last.path) == sum(k.stamp <= last.stamp for k in odometry.map.keyframes)


def test_a_first_key_frame_that_is_forgotten_closes_no_walk(rounds):
    _, _, odometry = ran_with(MOST, rounds[: ROUND + 1])
    assert odometry.closing_test() is None
    _, _, odometry = ran_with(400, rounds[: ROUND + 1])
    assert odometry.closing_test() is not None


def test_forgetting_is_the_same_again_and_when_colour_is_seen_early(forgetful, rounds):
    assert numbers(ran_with(MOST, rounds, anticipates=True)[0]) == numbers(forgetful[0])


def test_segments_that_are_never_tracked_are_forgotten_too():
    odometry = Odometry(SMALL, OdometrySettings(map_keyframes=10))
    for k in range(140):
        stamp = Stamp(START + 20 * k * PERIOD)
        if k % 4 == 0:
            seen = PaintedRoom(seed=k).frame(SMALL, 0, np.eye(4))
        color = np.zeros_like(seen.color) if k % 4 else seen.color
        odometry.process(replace(seen, sequence=k, stamp=stamp, depth_stamp=stamp, color=color))
    assert len(odometry._stages.map.keyframes) > 15
    assert len(odometry._stages.map.remembered) <= 11
