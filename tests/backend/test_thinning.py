"""Of key frames that show the same, one stays; what only one shows stays too."""

import numpy as np
import pytest
from made_up_scene import bare_keyframe
from scipy.sparse import csc_matrix

from odom.backend.map.map import Map
from odom.backend.map.thinning import landmarks_shown, least_telling
from odom.frame import Camera
from odom.geometry import se3

CAMERA = Camera(640, 480, 500.0, 500.0, 319.5, 239.5)


def test_of_twins_one_goes_and_the_lonely_stay():
    shown = np.zeros((4, 5))
    shown[0, :2] = 30.0  # two that fill the same square
    shown[1:, 2:] = 10.0 * np.eye(3)
    assert least_telling(csc_matrix(shown), 1, set())[0] in (0, 1)
    assert set(least_telling(csc_matrix(shown), 2, set())) & {0, 1} != {0, 1}


def test_what_is_needed_stays_and_no_more_goes_than_may():
    shown = csc_matrix(np.ones((3, 6)))
    assert set(least_telling(shown.copy(), 10, {0, 4})) == {1, 2, 3, 5}
    assert len(least_telling(shown.copy(), 2, {0})) == 2
    assert least_telling(shown.copy(), 0, {0}) == []


def test_every_square_keeps_something_while_that_can_be():
    rng = np.random.default_rng(0)
    shown = np.zeros((30, 60))
    for k in range(60):  # each square is shown by two key frames with many landmarks, and all others with few
        shown[k % 30, k] = rng.integers(20, 60)
        shown[(k * 7 + 3) % 30, k] += 1
    left = np.delete(shown, least_telling(csc_matrix(shown), 30, set()), axis=1)
    assert left.sum(axis=1).min() > 0
    assert (left.max(axis=1) >= 20).mean() > 0.9


def test_landmarks_count_where_linked_key_frames_see_them():
    map_ = Map()
    ahead, aside = np.eye(4), se3.exp(np.array([0.0, 0.0, 0.0, 0.0, 3.0, 0.0]))
    for number, T in enumerate((ahead, ahead, aside, ahead)):
        map_.keyframes.append(bare_keyframe(number, T))
        map_.links.append(set())
    map_.link(0, 1)
    map_.link(1, 2)
    points = np.array([[-1.0, -0.8, 2.0], [0.1, 0.0, 2.0], [0.2, 0.0, 2.0], [0.0, 0.0, -2.0], [9.0, 0.0, 2.0]])
    shown = landmarks_shown(map_, CAMERA, lambda number: points).toarray().reshape(4, 12, 4)
    for viewer, keyframe in ((0, 0), (0, 1), (1, 0), (3, 3)):
        squares = shown[viewer, :, keyframe]
        assert squares[0] == 1.0
        assert squares.sum() == 3.0
    assert shown[0, :, 3].sum() == shown[3, :, 0].sum() == 0.0  # not linked
    assert shown[2, :, 1].sum() == pytest.approx(1.0)  # turned away, it sees what is behind the other
