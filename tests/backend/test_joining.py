"""Parts of a map are joined where most key frames recognise each other, and not because some places look alike."""

from itertools import pairwise

import numpy as np
import pytest
from made_up_scene import bare_keyframe

from odom.backend.loop_closure.joining import join_parts
from odom.backend.map.map import Map
from odom.backend.map.pose_graph import Edge
from odom.geometry import se3

SURE = 1e-6 * np.eye(6)
COARSE = 25e-6 * np.eye(6)
"""Of a recognition by descriptors: 5 mm and 5 mrad each way."""
COUNT = 12
T_ELSEWHERE = se3.exp(np.array([1.0, -2.0, 0.5, 0.3, 0.2, -0.9]))


def walk(offset):
    """A walk of key frames that looks ahead and turns; `offset` to the side."""
    return [se3.exp(np.array([offset, 0.0, 0.15 * k, 0.0, 0.08 * k, 0.0])) for k in range(COUNT)]


def two_walks(beside=0.1):
    """A map of two walks `beside` each other, the second in coordinates of its own; and where all truly are."""
    rng = np.random.default_rng(0)
    map_, true = Map(), [*walk(0.0), *walk(beside)]
    for number, T in enumerate(true):
        segment = number // COUNT
        T_map = T if segment == 0 else T_ELSEWHERE @ T
        map_.keyframes.append(bare_keyframe(number, T_map, segment))
        map_.links.append(set())
        map_.remembered.append(number)
    for a, b in pairwise(range(2 * COUNT)):
        if a // COUNT == b // COUNT:
            T_a_b = map_.keyframes[a].T_camera_map @ se3.inverse(map_.keyframes[b].T_camera_map)
            map_.register(Edge(a, b, T_a_b @ se3.exp(1e-4 * rng.normal(size=6)), SURE))
    return map_, true


def seen(true, a, b, rng, wrong=None):
    noise = se3.exp(np.sqrt(np.diag(COARSE)) * rng.normal(size=6))
    T_wrong = np.eye(4) if wrong is None else wrong
    return Edge(a, b, se3.inverse(true[a]) @ T_wrong @ true[b] @ noise, COARSE)


def off(map_, true):
    return max(
        np.linalg.norm(se3.log(se3.inverse(T) @ se3.inverse(k.T_camera_map))[:3])
        for k, T in zip(map_.keyframes, true, strict=True)
    )


def test_two_walks_are_joined_where_they_were():
    map_, true = two_walks()
    rng = np.random.default_rng(1)
    found = [seen(true, a, COUNT + b, rng) for b in range(COUNT) for a in (b, max(0, b - 1))]
    joined = join_parts(map_, found, 0.0)
    assert len(joined.closures) == len(found)
    assert {k.segment for k in map_.keyframes} == {0}
    assert off(map_, true) < 0.004


def test_what_was_carried_elsewhere_is_refused_and_moves_nothing():
    map_, true = two_walks()
    rng = np.random.default_rng(2)
    carried = se3.exp(np.array([1.2, 0.0, 0.0, 0.0, 0.3, 0.0]))
    wrong = [seen(true, a, COUNT + a, rng, carried) for a in range(4)]
    found = [*wrong, *(seen(true, a, COUNT + a, rng) for a in range(COUNT))]
    joined = join_parts(map_, found, 0.0)
    assert joined.refused == len(wrong)
    assert off(map_, true) < 0.006


@pytest.mark.parametrize(("recognised", "is_joined"), [(2, False), (5, False), (8, True)])
def test_a_room_of_the_same_furniture_is_not_taken_for_this_one(recognised, is_joined):
    map_, true = two_walks()
    rng = np.random.default_rng(3)
    joined = join_parts(map_, [seen(true, a, COUNT + a, rng) for a in range(recognised)], 0.0)
    assert len({k.segment for k in map_.keyframes}) == (1 if is_joined else 2)
    assert bool(joined.closures) == is_joined
    assert joined.refused == (0 if is_joined else recognised)


def test_a_map_that_shares_a_corner_alone_is_joined_there():
    map_, true = two_walks()
    for k in map_.keyframes[COUNT + 4 :]:  # the second walk turns off into another room
        k.T_camera_map = se3.inverse(T_ELSEWHERE @ se3.exp(np.array([3.0, 0.0, 0.0, 0.0, 1.5, 0.0])) @ true[k.number])
    rng = np.random.default_rng(4)
    joined = join_parts(map_, [seen(true, a, COUNT + a, rng) for a in range(4)], 0.0)
    assert len(joined.closures) == 4


def test_a_walk_on_the_other_side_of_the_room_is_joined_by_what_both_see():
    map_, true = two_walks(beside=0.9)
    rng = np.random.default_rng(6)
    join_parts(map_, [seen(true, a, COUNT + a, rng) for a in range(2, COUNT)], 0.0)
    assert {k.segment for k in map_.keyframes} == {0}
    assert off(map_, true) < 0.006


def test_the_same_recognitions_give_the_same_map():
    poses = []
    for _ in range(2):
        map_, true = two_walks()
        rng = np.random.default_rng(5)
        join_parts(map_, [seen(true, a, COUNT + a, rng) for a in range(COUNT)], 0.01)
        poses.append(np.array([k.T_camera_map for k in map_.keyframes]).tobytes())
    assert poses[0] == poses[1]
