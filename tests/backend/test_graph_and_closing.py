from itertools import pairwise

import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_scene import bare_keyframe, chain_of_keyframes

from odom.backend.loop_closure.closing import close_loops, merge_segment
from odom.backend.loop_closure.graph import SegmentGraph
from odom.backend.loop_closure.verification import contradiction
from odom.backend.map.frame_log import LoggedFrame
from odom.backend.map.map import Map
from odom.backend.map.pose_covariance import relative_covariance
from odom.backend.map.pose_graph import Edge, EdgeArrays, optimise, optimise_with_covariance
from odom.backend.map.registrations import Registrations
from odom.backend.odometry.final_trajectory import trajectory
from odom.frame import Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3

SMALL = np.diag([1e-4] * 3 + [1e-5] * 3) ** 1.0 * 0.01
COUNT = 24


def circle():
    """Key frames on a circle, looking outward; the last stands where the first does."""
    out = []
    for angle in np.linspace(0.0, 2.0 * np.pi, COUNT):
        T = np.eye(4)
        T[:3, :3] = se3.so3_exp(np.array([0.0, angle, 0.0]))
        T[:3, 3] = T[:3, :3] @ [0.0, 0.0, 1.5]
        out.append(T)
    return out


def drifted(poses, sigma=0.004, seed=0):
    rng = np.random.default_rng(seed)
    out = [poses[0]]
    for a, b in pairwise(poses):
        out.append(out[-1] @ se3.inverse(a) @ b @ se3.exp(sigma * rng.normal(size=6)))
    return out


def gap(a, b):
    return np.linalg.norm(se3.log(se3.inverse(a) @ b))


def optimised(poses, edges):
    """T_map_keyframe after the edges were met, the first one held."""
    is_held = np.arange(len(poses)) == 0
    found = optimise(np.array([se3.inverse(T) for T in poses]), is_held, EdgeArrays.of(edges))
    return [se3.inverse(T) for T in found]


def test_a_drifted_loop_is_pulled_closed_and_the_held_pose_stays():
    true = circle()
    start = drifted(true)
    edges = [Edge(k, k + 1, se3.inverse(start[k]) @ start[k + 1], SMALL) for k in range(COUNT - 1)]
    loop = Edge(0, COUNT - 1, se3.inverse(true[0]) @ true[-1], SMALL * 0.1, True)
    found = optimised(start, [*edges, loop])
    assert gap(found[0], true[0]) < 1e-5
    assert gap(found[0], found[COUNT - 1]) < 0.1 * gap(start[0], start[-1])
    before, after = ([gap(p[k], true[k]) for k in range(COUNT)] for p in (start, found))
    assert np.mean(after) < 0.7 * np.mean(before)


def test_a_wrong_loop_among_right_ones_does_not_tear_the_map():
    true = circle()
    start = drifted(true)
    edges = [Edge(k, k + 1, se3.inverse(start[k]) @ start[k + 1], SMALL) for k in range(COUNT - 1)]
    right = [Edge(0, COUNT - 1, se3.inverse(true[0]) @ true[-1], SMALL * 0.1, True)]
    right += [Edge(1, COUNT - 1, se3.inverse(true[1]) @ true[-1], SMALL * 0.1, True)]
    wrong = Edge(4, 15, se3.exp(np.array([0.8, 0, 0, 0, 0.3, 0])) @ se3.inverse(true[4]) @ true[15], SMALL, True)
    good, bad = (optimised(start, [*edges, *right, *more]) for more in ([], [wrong]))
    assert max(gap(good[k], bad[k]) for k in range(COUNT)) < 0.3


@given(st.integers(0, 10_000), st.integers(0, 8), st.booleans())
@settings(max_examples=30, deadline=None)
def test_poses_agree_as_gtsam_has_it(seed, loops, is_torn):
    rng, true = np.random.default_rng(seed), circle()
    start = drifted(true, seed=seed)
    edges = [Edge(k, k + 1, se3.inverse(start[k]) @ start[k + 1], SMALL) for k in range(COUNT - 1)]
    for _ in range(loops):
        a, b = sorted(rng.choice(COUNT, 2, replace=False).tolist())
        away = se3.exp(0.002 * rng.normal(size=6) + is_torn * rng.normal(size=6))
        edges.append(Edge(a, b, se3.inverse(true[a]) @ true[b] @ away, SMALL * rng.uniform(0.1, 2.0), True))
    expected, claimed = as_gtsam_has_it(start, edges)
    found = optimised(start, edges)
    assert cost(found, edges) < 1.001 * cost([expected[k] for k in range(COUNT)], edges) + 1e-6
    if not is_torn:
        assert max(gap(found[k], expected[k]) for k in range(COUNT)) < 3e-4  # a third of a link's sigma
        poses, covariance = optimise_with_covariance(dict(enumerate(start)), [0], edges, COUNT - 1)
        assert max(gap(poses[k], found[k]) for k in range(COUNT)) < 1e-9
        scale = np.sqrt(np.diag(claimed))
        assert np.abs((covariance - claimed) / np.outer(scale, scale)).max() < 0.02


def as_gtsam_has_it(poses, edges):
    """T_map_keyframe that meet the edges, the first one held, and the covariance of the last."""
    swap = np.r_[3:6, 0:3]  # gtsam's tangent has the rotation first
    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for number, T in enumerate(poses):
        start.insert(number, gtsam.Pose3(T))
    still = gtsam.noiseModel.Isotropic.Sigma(6, 1e-6)
    graph.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(poses[0]), still))
    for edge in edges:
        noise = gtsam.noiseModel.Gaussian.Covariance(edge.covariance[np.ix_(swap, swap)] + 1e-12 * np.eye(6))
        if edge.is_loop:
            noise = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Huber.Create(3.0), noise)
        graph.add(gtsam.BetweenFactorPose3(edge.a, edge.b, gtsam.Pose3(edge.T_a_b), noise))
    result = gtsam.LevenbergMarquardtOptimizer(graph, start).optimize()
    last = len(poses) - 1
    covariance = gtsam.Marginals(graph, result).marginalCovariance(last)[np.ix_(swap, swap)]
    return [result.atPose3(k).matrix() for k in range(len(poses))], covariance


def test_poses_that_nothing_determines_are_told():
    poses = {k: np.eye(4) for k in range(3)}
    with pytest.raises(RuntimeError):
        optimise_with_covariance(poses, [0], [Edge(0, 1, np.eye(4), SMALL)], 2)


def test_a_held_pose_has_no_covariance():
    poses = {7: np.eye(4), 9: np.eye(4)}
    found, covariance = optimise_with_covariance(poses, [7], [Edge(7, 9, se3.exp(np.full(6, 0.1)), SMALL)], 7)
    assert gap(found[9], se3.exp(np.full(6, 0.1))) < 1e-9
    assert not covariance.any()


def cost(poses, edges):
    """What the edges cost: squared sigmas, beyond three of a loop in proportion."""
    total = 0.0
    for e in edges:
        r = se3.log(se3.inverse(e.T_a_b) @ se3.inverse(poses[e.a]) @ poses[e.b])
        sigmas = np.sqrt(r @ np.linalg.solve(e.covariance, r))
        total += 3.0 * (2.0 * sigmas - 3.0) if e.is_loop and sigmas > 3.0 else sigmas**2
    return total


def test_the_surest_way_is_found_in_the_frozen_graph_as_in_the_map():
    map_ = chain_of_keyframes(circle(), SMALL)
    map_.register(Edge(2, 20, se3.inverse(circle()[2]) @ circle()[20], SMALL * 0.1, True))
    graph = SegmentGraph.of(map_, 0)
    for a, b in ((0, 5), (1, 22), (21, 3), (2, 20), (7, 7)):
        expected = map_.registrations.covariance_between(a, b)
        np.testing.assert_allclose(graph.covariance_between(a, b), expected, rtol=1e-6, atol=1e-15)


def test_what_is_new_or_was_adjusted_while_a_loop_was_closed_moves_with_what_is_around_it():
    true = circle()
    map_ = chain_of_keyframes(drifted(true)[:-2], SMALL)
    graph = SegmentGraph.of(map_, 0)
    closure = Edge(0, COUNT - 3, se3.inverse(true[0]) @ true[COUNT - 3], SMALL * 0.1, True)
    moved = graph.with_closures([closure]).optimised()
    adjusted = map_.keyframes[9].T_camera_map = se3.exp(np.full(6, 0.01)) @ map_.keyframes[9].T_camera_map
    new = bare_keyframe(COUNT - 2, drifted(true)[COUNT - 2])
    before = new.T_camera_map @ se3.inverse(map_.keyframes[COUNT - 3].T_camera_map)
    map_.keyframes.append(new)
    map_.links.append(set())
    map_.remembered.append(new.number)
    map_.register(Edge(COUNT - 3, COUNT - 2, se3.inverse(before), SMALL))
    graph.take_over(map_, moved)
    goal = dict(zip(moved.numbers, moved.after, strict=True))
    np.testing.assert_allclose(map_.keyframes[12].T_camera_map, goal[12], atol=1e-9)
    after = map_.keyframes[9].T_camera_map
    np.testing.assert_allclose(after @ se3.inverse(goal[9]), adjusted @ se3.inverse(graph.poses[9]), atol=1e-9)
    now = new.T_camera_map @ se3.inverse(map_.keyframes[COUNT - 3].T_camera_map)
    np.testing.assert_allclose(now, before, atol=1e-9)


def test_closing_moves_landmarks_with_their_key_frames():
    true = circle()
    start = drifted(true)
    map_ = chain_of_keyframes(start, SMALL)
    L = map_.landmarks
    in_camera = [se3.apply(k.T_camera_map, L.position[L.keyframe == k.number]) for k in map_.keyframes]
    alive = L.alive.copy()
    close_loops(map_, [Edge(0, COUNT - 1, se3.inverse(true[0]) @ true[-1], SMALL * 0.1, True)])
    assert gap(*(se3.inverse(map_.keyframes[k].T_camera_map) for k in (0, COUNT - 1))) < 0.1 * gap(start[0], start[-1])
    for k, before in zip(map_.keyframes, in_camera, strict=True):
        here = (L.keyframe == k.number) & alive
        np.testing.assert_allclose(se3.apply(k.T_camera_map, L.position[here]), before[: here.sum()], atol=1e-9)


def test_a_closure_makes_its_two_ends_sure_of_each_other_and_all_between_none_the_less():
    true = circle()
    map_ = chain_of_keyframes(true, SMALL)
    between = map_.registrations.covariance_between
    before = {(a, b): between(a, b) for a, b in ((0, COUNT - 1), (3, 9), (2, COUNT - 3))}
    close_loops(map_, [Edge(0, COUNT - 1, se3.inverse(true[0]) @ true[-1], SMALL * 0.1, True)])
    np.testing.assert_allclose(between(0, COUNT - 1), SMALL * 0.1, atol=1e-15)
    np.testing.assert_array_equal(between(3, 9), before[3, 9])
    assert np.trace(between(2, COUNT - 3)) < 0.5 * np.trace(before[2, COUNT - 3])


def test_a_wrong_closure_gains_nothing_by_those_that_follow():
    true = circle()
    map_ = chain_of_keyframes(true, SMALL)
    wrong = Edge(4, 15, se3.exp(np.array([0.8, 0, 0, 0, 0.3, 0])) @ se3.inverse(true[4]) @ true[15], SMALL, True)
    close_loops(map_, [wrong])
    off = [max(gap(se3.inverse(k.T_camera_map), T) for k, T in zip(map_.keyframes, true, strict=True))]
    for k in range(6):
        close_loops(map_, [Edge(k, COUNT - 1 - k, se3.inverse(true[k]) @ true[COUNT - 1 - k], SMALL * 0.1, True)])
        off.append(max(gap(se3.inverse(k.T_camera_map), T) for k, T in zip(map_.keyframes, true, strict=True)))
    assert max(off) < 1.2 * off[0]
    assert off[-1] < off[0]


def test_closures_at_once_move_the_key_frames_to_where_they_move_one_after_the_other():
    true = circle()
    closures = [Edge(k, COUNT - 1 - k, se3.inverse(true[k]) @ true[COUNT - 1 - k], SMALL * 0.1, True) for k in range(3)]
    at_once, in_turn = (chain_of_keyframes(drifted(true), SMALL) for _ in range(2))
    close_loops(at_once, closures)
    for closure in closures:
        close_loops(in_turn, [closure])
    moved = gap(drifted(true)[-1], se3.inverse(in_turn.keyframes[-1].T_camera_map))
    for a, b in zip(at_once.keyframes, in_turn.keyframes, strict=True):
        assert gap(se3.inverse(a.T_camera_map), se3.inverse(b.T_camera_map)) < 0.02 * moved


def test_merging_a_segment_keeps_its_shape_and_its_landmarks():
    map_ = two_segments(circle()[:6])
    L = map_.landmarks
    poses = [k.T_camera_map.copy() for k in map_.keyframes]
    points, covariances = L.position.copy(), L.covariance.copy()
    T_new_old = se3.exp(np.array([1.0, -2.0, 0.5, 0.4, -1.0, 0.3]))
    merge_segment(map_, Edge(1, 5, poses[1] @ T_new_old @ se3.inverse(poses[5]), SMALL))
    assert {k.segment for k in map_.keyframes} == {0}
    for a, b in ((3, 4), (4, 5), (3, 5)):
        np.testing.assert_allclose(
            map_.keyframes[a].T_camera_map @ se3.inverse(map_.keyframes[b].T_camera_map),
            poses[a] @ se3.inverse(poses[b]),
            atol=1e-9,
        )
    moved = L.alive & (L.keyframe >= 3)
    np.testing.assert_allclose(L.position[moved], se3.apply(T_new_old, points[moved]), atol=1e-9)
    R = T_new_old[:3, :3]
    np.testing.assert_allclose(L.covariance[moved], R @ covariances[moved] @ R.T, atol=1e-15)
    np.testing.assert_array_equal(L.position[L.alive & (L.keyframe < 3)], points[L.alive & (L.keyframe < 3)])
    for k in range(3):
        np.testing.assert_array_equal(map_.keyframes[k].T_camera_map, poses[k])


def two_segments(poses, drift=0.0):
    """A map of two segments of key frames at `poses`, the second one off by `drift` metres."""
    half = len(poses) // 2
    off = se3.exp(np.array([drift, 0, 0, 0, 0, 0]))
    return chain_of_keyframes([*poses[:half], *(off @ T for T in poses[half:])], SMALL, begins=(0, half))


def test_merged_segments_are_as_sure_of_each_other_as_their_registration_and_of_themselves_as_before():
    map_ = two_segments(circle()[:8])
    k = map_.keyframes
    ends = ((4, 7), (7, 4), (5, 6), (0, 3))
    covariance_between = map_.registrations.covariance_between
    before = [covariance_between(a, b) for a, b in ends]
    covariance = np.diag(np.arange(1.0, 7.0)) * 1e-5
    T_1_7 = k[1].T_camera_map @ se3.inverse(k[7].T_camera_map)
    merge_segment(map_, Edge(1, 7, T_1_7, covariance))
    for (a, b), expected in zip(ends, before, strict=True):
        np.testing.assert_allclose(covariance_between(a, b), expected, atol=1e-15)
    np.testing.assert_allclose(covariance_between(1, 7), covariance, atol=1e-15)
    T_7_4 = k[7].T_camera_map @ se3.inverse(k[4].T_camera_map)
    over_the_joint = se3.compose_covariance(covariance, T_7_4, covariance_between(7, 4))
    np.testing.assert_allclose(covariance_between(1, 4), over_the_joint, atol=1e-15)
    for number in (4, 5, 6, 7):
        T_1_k = k[1].T_camera_map @ se3.inverse(k[number].T_camera_map)
        since = se3.compose_covariance(k[1].covariance_since_start, T_1_k, covariance_between(1, number))
        np.testing.assert_allclose(k[number].covariance_since_start, since, atol=1e-15)


def test_a_loop_closed_after_a_merge_keeps_what_joined_the_segments():
    true = circle()[:8]
    map_ = two_segments(true, drift=2.0)

    def relative(a, b):
        return map_.keyframes[a].T_camera_map @ se3.inverse(map_.keyframes[b].T_camera_map)

    joint = se3.inverse(true[1]) @ true[7]
    merge_segment(map_, Edge(1, 7, joint, SMALL))
    off = se3.exp(np.array([0.02, 0, 0, 0, 0, 0]))
    close_loops(map_, [Edge(0, 4, se3.inverse(true[0]) @ true[4] @ off, SMALL, True)])
    assert 0.001 < gap(relative(1, 7), joint) < 0.01
    assert gap(relative(0, 4), se3.inverse(true[0]) @ true[4] @ off) < 0.018


def test_a_closure_three_metres_wrong_contradicts_the_chain_and_a_right_one_does_not():
    true = circle()
    map_ = chain_of_keyframes(drifted(true, 0.003), np.eye(6) * 0.003**2)
    right = se3.inverse(true[0]) @ true[-1]
    graph = SegmentGraph.of(map_, 0)
    assert contradiction(graph, Edge(0, COUNT - 1, right, SMALL), 0.0) == ""
    wrong = se3.exp(np.array([3.0, 0, 0, 0, 0, 0])) @ right
    assert "3.0" in contradiction(graph, Edge(0, COUNT - 1, wrong, SMALL), 0.0)
    turned = right @ se3.exp(np.array([0, 0, 0, 0, 0.5, 0]))
    assert "deg" in contradiction(graph, Edge(0, COUNT - 1, turned, SMALL), 0.0)


def test_covariances_add_up_along_the_chain_of_registrations():
    rng = np.random.default_rng(1)
    poses = [se3.exp(0.3 * rng.normal(size=6)) for _ in range(6)]
    covariances = [root @ root.T for root in 0.01 * rng.normal(size=(6, 6, 6))]

    def relative(a, b):
        return se3.inverse(poses[a]) @ poses[b]

    registrations = Registrations()
    for k, against in enumerate([0, 1, 1, 3, 4], 1):
        registrations.add(Edge(against, k, relative(against, k), covariances[k]))
    covariance_between = registrations.covariance_between
    step_3_4_5 = se3.compose_covariance(covariances[4], relative(4, 5), covariances[5])
    along = se3.compose_covariance(covariances[3], relative(3, 5), step_3_4_5)
    np.testing.assert_allclose(covariance_between(1, 5), along, rtol=1e-9)
    up = se3.inverse_covariance(relative(1, 2), covariances[2])
    across = se3.compose_covariance(up, relative(1, 5), along)
    np.testing.assert_allclose(covariance_between(2, 5), across, rtol=1e-9)
    np.testing.assert_allclose(covariance_between(5, 2), se3.inverse_covariance(relative(2, 5), across), rtol=1e-9)
    assert (covariance_between(4, 4) == 0).all()


def test_no_covariance_is_claimed_across_a_loss_or_between_segments():
    map_ = Map(keyframes=[bare_keyframe(0, np.eye(4)), bare_keyframe(1, np.eye(4), segment=1)])
    here = LoggedFrame(Stamp(0), 0, 0.0, 0, np.eye(4), np.eye(6))
    there = LoggedFrame(Stamp(10), 1, 0.0, 1, np.eye(4), np.eye(6))
    lost, again = LoggedFrame(Stamp(10), 0, 0.0), LoggedFrame(Stamp(10), 0, 0.0, 0, np.eye(4), np.eye(6))
    assert relative_covariance(map_, here, there, np.eye(4), 0.0, 0.0) is None
    assert relative_covariance(map_, here, lost, np.eye(4), 0.0, 0.0) is None
    assert relative_covariance(map_, here, again, np.eye(4), 0.0, 0.0) is not None


def test_a_motion_over_a_step_back_of_the_stamps_is_as_unsure_as_over_one_ahead():
    map_ = Map(keyframes=[bare_keyframe(0, np.eye(4))])
    then, later, set_back = (LoggedFrame(Stamp(s * 10**9), 0, 0.0, 0, np.eye(4), np.eye(6)) for s in (60, 90, 30))
    ahead, back = (relative_covariance(map_, then, now, np.eye(4), 0.0, 0.0) for now in (later, set_back))
    np.testing.assert_array_equal(back, ahead)


def test_a_motion_is_as_unsure_as_the_map_has_moved_since_it_began():
    rng = np.random.default_rng(2)
    poses = [np.eye(4), se3.exp(0.2 * rng.normal(size=6))]
    map_ = chain_of_keyframes(poses, 1e-6 * np.eye(6))
    frames = [
        LoggedFrame(Stamp(k * 1_000_000_000), 0, 0.0, k, se3.exp(0.1 * rng.normal(size=6)), 1e-6 * np.eye(6))
        for k in range(2)
    ]

    def T_map_camera(k):
        return se3.inverse(map_.keyframes[k].T_camera_map) @ frames[k].T_keyframe_camera

    T_then = T_map_camera(0)
    sure = relative_covariance(map_, *frames, se3.inverse(T_then) @ T_map_camera(1), 0.0, 0.0)
    moved = se3.exp(0.03 * rng.normal(size=6))
    map_.move_keyframes(np.array([0]), (map_.keyframes[0].T_camera_map @ moved)[None])
    published = se3.inverse(T_then) @ T_map_camera(1)
    unsure = relative_covariance(map_, *frames, published, 0.0, 0.0)
    error = se3.log(se3.inverse(se3.inverse(T_map_camera(0)) @ T_map_camera(1)) @ published)
    assert error @ np.linalg.solve(sure, error) > 100.0
    assert error @ np.linalg.solve(unsure, error) < 1.0


def test_the_trajectory_carries_every_pose_to_its_stamp():
    """The delay is by what is known of the shutter now, whatever was known when the frame was taken."""
    twist, period, timing = np.array([0.3, -0.2, 0.1, 0.5, 0.8, -0.4]), 33_333_333, ShutterTiming(readout_s=0.014)
    late_s, delay_s = 0.002, 0.009
    keyframes = [bare_keyframe(0, se3.exp(np.full(6, 0.2)))]
    T_map_keyframe = se3.inverse(keyframes[0].T_camera_map)

    def at(seconds):
        return T_map_keyframe @ se3.exp(twist * seconds)

    frames = [
        LoggedFrame(Stamp(i * period), 0, late_s, 0, se3.inverse(T_map_keyframe) @ at(i * period * 1e-9 - delay_s))
        for i in range(8)
    ]
    lost = LoggedFrame(Stamp(8 * period), 0)
    poses = trajectory([*frames, lost], keyframes, timing)
    assert poses[8].T_map_camera is None
    for i, pose in enumerate(poses[:8]):
        assert pose.stamp == i * period
        np.testing.assert_allclose(pose.T_map_camera, at(i * period * 1e-9), atol=1e-9)


def test_a_pose_of_the_stamp_itself_is_left_there():
    frames = [LoggedFrame(Stamp(i * 33_333_333), 0, None, 0, se3.exp(np.full(6, 0.01 * i))) for i in range(3)]
    poses = trajectory(frames, [bare_keyframe(0, np.eye(4))], ShutterTiming(readout_s=0.03))
    for frame, pose in zip(frames, poses, strict=True):
        np.testing.assert_array_equal(pose.T_map_camera, frame.T_keyframe_camera)


def test_frames_far_apart_are_carried_to_their_stamps_by_their_own_velocities():
    timing, delay_s = ShutterTiming(readout_s=-0.027), 0.0135
    period, keyframes = 267_000_000, [bare_keyframe(0, np.eye(4))]
    twists = np.random.default_rng(1).uniform(-0.3, 0.3, (8, 6))
    poses = [se3.exp(np.full(6, 0.05 * i)) for i in range(8)]
    frames = [
        LoggedFrame(Stamp(i * period), 0, 0.0, 0, T, twist=None if i == 3 else twist)
        for i, (T, twist) in enumerate(zip(poses, twists, strict=True))
    ]
    for i, (pose, T) in enumerate(zip(trajectory(frames, keyframes, timing), poses, strict=True)):
        wanted = T if i == 3 else T @ se3.exp(delay_s * twists[i])
        np.testing.assert_allclose(pose.T_map_camera, wanted, atol=1e-12)


def test_links_lead_to_near_key_frames_only():
    map_: Map = chain_of_keyframes(circle(), SMALL)
    near = map_.neighbours(10, map_.keyframes[10].T_camera_map, 5)
    assert near[0] == 10
    assert set(near) <= set(range(7, 14))
    assert len(near) == 5
