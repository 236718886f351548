import itertools

import numpy as np
import pytest

from odom.errors import ConfigError
from odom.geometry import se3
from sensors.arena import ArenaOptions, frame
from sensors.arena.camera_path import make_walk
from sensors.arena.options import FRAMES_PER_KEY_POSE, KEY_POSES, RATE_HZ


def poses(options: ArenaOptions, count: int) -> list[np.ndarray]:
    walk = make_walk(options)
    return [walk.T_world_camera(k / RATE_HZ) for k in range(count)]


@pytest.mark.parametrize("seed", [1, 7])
def test_the_infinity_ends_where_it_began_and_crosses_itself_between(seed: int) -> None:
    options = ArenaOptions(seed=seed)
    T = poses(options, options.frames)
    assert options.frames == KEY_POSES * FRAMES_PER_KEY_POSE + 1
    assert np.allclose(T[0], T[-1], atol=1e-9)
    middle = T[len(T) // 2]
    assert np.linalg.norm((middle - T[0])[:2, 3]) < 0.06
    x = np.array([t[0, 3] for t in T])
    assert x.max() > 1.6
    assert x.min() < -1.6


@pytest.mark.parametrize("options", [ArenaOptions(seed=1), ArenaOptions(seed=5), ArenaOptions(walk="corridor")])
def test_speeds_are_those_of_a_camera_carried_by_hand(options: ArenaOptions) -> None:
    T = poses(options, 900)
    steps = [se3.log(se3.inverse(a) @ b) for a, b in itertools.pairwise(T)]
    speed = np.array([np.linalg.norm(s[:3]) for s in steps]) * RATE_HZ
    turn = np.degrees([np.linalg.norm(s[3:]) for s in steps]) * RATE_HZ
    assert 0.2 < np.median(speed) < 0.4
    assert speed.max() < 0.6
    assert turn.max() < 45
    jerk = np.linalg.norm(np.diff([s[:3] for s in steps], n=2, axis=0), axis=1)
    assert jerk.max() * RATE_HZ < 0.05


def test_a_camera_at_rest_does_not_move() -> None:
    T = poses(ArenaOptions(walk="rest"), 60)
    assert all(np.array_equal(T[0], t) for t in T)


def test_every_lap_is_the_same() -> None:
    walk = make_walk(ArenaOptions(laps=11))
    assert ArenaOptions(laps=11).frames > 10_000
    for t in (0.0, 3.3, 21.7):
        assert np.allclose(walk.T_world_camera(t), walk.T_world_camera(t + 10 * 32.0), atol=1e-9)


def test_structure_is_seen_at_several_depths() -> None:
    options = ArenaOptions()
    medians = []
    for index in range(0, 960, 96):
        depth = frame(options, index).depth_mm
        seen = depth[depth > 0]
        assert seen.size > 0.45 * depth.size
        medians.append(np.median(seen) / 1000)
        assert np.percentile(seen, 98) / np.percentile(seen, 2) > 1.2
    assert min(medians) > 0.8
    assert max(medians) < 4.0


@pytest.mark.parametrize(
    "texts", [{"walk": "moon"}, {"laps": "0"}, {"seed": "x"}, {"colour": "1"}, {"faults": "perhaps"}]
)
def test_options_that_do_not_fit_are_refused(texts: dict[str, str]) -> None:
    with pytest.raises(ConfigError):
        ArenaOptions.from_texts(texts)


def test_options_are_read_from_texts() -> None:
    texts = {"walk": "rest", "seconds": "2.5", "half": "true", "seed": "4", "mocap_offset_s": "-0.1"}
    expected = ArenaOptions(walk="rest", seconds=2.5, half=True, seed=4, mocap_offset_s=-0.1)
    assert ArenaOptions.from_texts(texts) == expected
