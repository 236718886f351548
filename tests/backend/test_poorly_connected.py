"""A key frame that shares hardly any landmarks with others is not adjusted by them: it moves with its neighbour."""

import numpy as np
import pytest
from made_up_scene import blank_view, chain_of_keyframes, exact, project
from sensor_models import sensor_model

from odom.backend.map.keyframe import MeasuredLandmarks
from odom.backend.mapping.intermediate_frames import IntermediateFrames
from odom.backend.mapping.map_adjustment import everything, newest, take_over
from odom.backend.mapping.tuning import TUNING
from odom.frame import Camera
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3

SMALL = Camera(64, 48, 50.0, 50.0, 32.0, 24.0)
COVARIANCE = 1e-4 * np.eye(6)
STEP = se3.exp(np.array([0.05, 0.0, 0.02, 0.0, 0.04, 0.0]))


def looks_back(map_, T_camera_map, T_said, rows):
    """Add a key frame that is said to be at `T_said`, and measures the landmarks `rows` from `T_camera_map`."""
    measured = exact(project(T_camera_map, map_.landmarks.position[rows]))
    number = len(map_.keyframes)
    seen = MeasuredLandmarks(np.asarray(rows), np.full((len(rows), 2), 30.0), measured)
    map_.add_keyframe(blank_view(number), T_said, seen, ShutterTiming(), number - 1, COVARIANCE)


def a_map(shared):
    """A map of three key frames: the second, 4 cm off, shares 20 landmarks, the third, 20 cm off, as many as `shared`.

    Returns the map and the true poses of the two.
    """
    map_ = chain_of_keyframes([np.eye(4)], COVARIANCE)
    T_1, T_2 = STEP, STEP @ STEP
    looks_back(map_, T_1, se3.exp(np.array([0.04, 0.0, 0.0, 0.0, 0.0, 0.0])) @ T_1, np.arange(20))
    looks_back(map_, T_2, se3.exp(np.array([0.0, 0.2, 0.0, 0.0, 0.0, 0.0])) @ T_2, np.arange(shared))
    return map_, T_1, T_2


def adjusted(map_, of):
    sensor = sensor_model(SMALL)
    whole = {
        everything: lambda: everything(map_, IntermediateFrames(), 0, sensor, credit=1.0),
        newest: lambda: newest(map_, 3, sensor, credit=1.0),
    }[of]()
    take_over(map_, whole, whole.run())


@pytest.mark.parametrize("of", [everything, newest])
@pytest.mark.parametrize("shared", [0, 1, 2, TUNING.adjust_shared - 1])
def test_with_few_landmarks_it_moves_with_the_key_frame_that_it_was_registered_against(of, shared):
    map_, T_1, _ = a_map(shared)
    before = map_.keyframes[2].T_camera_map @ se3.inverse(map_.keyframes[1].T_camera_map)
    adjusted(map_, of)
    np.testing.assert_allclose(map_.keyframes[1].T_camera_map, T_1, atol=2e-3)
    after = map_.keyframes[2].T_camera_map @ se3.inverse(map_.keyframes[1].T_camera_map)
    np.testing.assert_allclose(after, before, atol=1e-9)
    np.testing.assert_allclose(map_.registrations.between(1, 2).seen_from(2).T_a_b, before, atol=1e-9)


@pytest.mark.parametrize("of", [everything, newest])
def test_with_enough_of_them_it_is_adjusted(of):
    map_, _, T_2 = a_map(TUNING.adjust_shared)
    adjusted(map_, of)
    np.testing.assert_allclose(map_.keyframes[2].T_camera_map, T_2, atol=2e-3)
