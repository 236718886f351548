import numpy as np
import pytest

from odom.geometry import se3
from sensors.arena import ArenaOptions
from sensors.arena.camera_path import make_walk
from sensors.arena.motion_capture import RATE_HZ, T_camera_marker, T_mocap_world, mocap_pose


def test_its_world_has_y_up() -> None:
    up_world = np.array([0.0, 0.0, 1.0])
    assert np.allclose(T_mocap_world(3)[:3, :3] @ up_world, [0, 1, 0])
    assert np.isclose(np.linalg.det(T_mocap_world(3)[:3, :3]), 1)


def test_the_marker_body_is_where_the_options_say() -> None:
    T = T_camera_marker(ArenaOptions(marker_m=0.08, marker_deg=30.0))
    assert np.isclose(np.linalg.norm(T[:3, 3]), 0.08)
    assert np.isclose(np.degrees(np.linalg.norm(se3.so3_log(T[:3, :3]))), 30.0)


def test_poses_are_true_but_for_jitter_clock_and_gaps() -> None:
    options = ArenaOptions(mocap_offset_s=0.037)
    walk = make_walk(options)
    count, errors, stamps = int(20 * RATE_HZ), [], []
    for k in range(count):
        pose = mocap_pose(options, k)
        if pose is None:
            continue
        t = k / RATE_HZ
        stamps.append(abs((pose.stamp - options.start) * 1e-9 - t - 0.037))
        truth = T_mocap_world(options.seed) @ walk.T_world_camera(t) @ T_camera_marker(options)
        errors.append(se3.log(se3.inverse(truth) @ pose.T_mocap_marker))
    assert 0.9 * count < len(errors) < 0.998 * count
    error = np.array(errors)
    assert np.allclose(error[:, :3].std(axis=0), 0.00025, rtol=0.2)
    assert np.allclose(np.degrees(error[:, 3:].std(axis=0)), 0.04, rtol=0.2)
    assert np.abs(error.mean(axis=0)).max() < 5e-5
    assert max(stamps) < 0.0003


@pytest.mark.parametrize("seed", [1, 2])
def test_a_pose_does_not_depend_on_those_before(seed: int) -> None:
    options = ArenaOptions(seed=seed)
    a, b = mocap_pose(options, 500), mocap_pose(options, 500)
    assert (a is None) == (b is None)
    if a is not None and b is not None:
        assert a.stamp == b.stamp
        assert np.array_equal(a.T_mocap_marker, b.T_mocap_marker)
