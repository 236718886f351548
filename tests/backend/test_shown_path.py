"""What is shown of the path is where the key frames are, though most of it is not worked out again."""

import numpy as np
from made_up_scene import chain_of_keyframes

from odom.backend.map import shown
from odom.backend.map.map import Map
from odom.backend.map.shown import ShownPath
from odom.geometry import se3


def poses(count):
    return [se3.exp(np.array([0.1 * k, 0.0, 0.0, 0.0, 0.02 * k, 0.0])) for k in range(count)]


def expected(map_, numbers):
    keyframes = [map_.keyframes[n] for n in numbers]
    return [(k.stamp, k.segment, se3.inverse(k.T_camera_map) @ k.T_middle_stamp) for k in keyframes]


def is_where(path, wanted):
    assert [(one.stamp, one.segment) for one in path] == [(stamp, segment) for stamp, segment, _ in wanted]
    np.testing.assert_allclose([one.T_map_camera for one in path], [T for _, _, T in wanted], atol=1e-12)


def test_the_path_follows_key_frames_that_are_added_moved_joined_and_set_aside():
    map_, path = chain_of_keyframes(poses(12), 1e-6 * np.eye(6)), ShownPath()
    numbers = range(12)
    before = path.of(map_)
    is_where(before, expected(map_, numbers))
    T = np.array([map_.keyframes[n].T_camera_map @ se3.exp(np.full(6, 0.1)) for n in (3, 4)])
    map_.move_keyframes(np.array([3, 4]), T)
    map_.keyframes[7].T_middle_stamp = se3.exp(np.full(6, 0.01))
    map_.keyframes[9].segment = 1
    map_.remembered.remove(2)
    map_.away.add(2)
    after = path.of(map_)
    is_where(after, expected(map_, numbers))
    same = [one is other for one, other in zip(before, after, strict=True)]
    assert [n for n in numbers if not same[n]] == [3, 4, 7, 9]


def test_of_many_far_key_frames_some_are_shown(monkeypatch):
    monkeypatch.setattr(shown, "_MOST_FAR_IN_PATH", 10)
    map_, path = chain_of_keyframes(poses(30), 1e-6 * np.eye(6)), ShownPath()
    map_.remembered, map_.away = list(range(25, 30)), set(range(25))
    before = path.of(map_)
    assert [one.stamp // 10**9 for one in before] == [*range(0, 25, 4), *range(25, 30)]
    map_.remembered, map_.away = list(range(20, 27)), {*range(20), *range(27, 30)}
    after = path.of(map_)
    assert [one.stamp // 10**9 for one in after] == [*range(0, 20, 4), *range(20, 27), 28]
    assert len(set(map(id, after)) - set(map(id, before))) == 3, "of those shown before, each is the same value"


def test_an_empty_map_has_an_empty_path():
    assert ShownPath().of(Map()) == ()


def test_the_path_is_shown_when_there_is_time_and_soon_at_any_rate():
    path = ShownPath()
    assert not path.is_due(is_other=False, has_time=True)
    assert path.is_due(is_other=True, has_time=True)
    assert not path.is_due(is_other=True, has_time=False)
    assert path.is_due(is_other=False, has_time=True)
    assert not path.is_due(is_other=False, has_time=True)
    assert [path.is_due(is_other=True, has_time=False) for _ in range(12)] == 2 * [*5 * [False], True]
