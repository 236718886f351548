"""Key frames made while older ones were adjusted move with them and are fitted to another lens; landmarks follow."""

import numpy as np
import pytest
from made_up_scene import blank_view, exact, points_ahead, project

from odom.backend.map.corners import Corners
from odom.backend.map.keyframe import MeasuredLandmarks
from odom.backend.map.map import Map
from odom.backend.mapping.newer_keyframes import carry_newer, refit_newer
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3

OWN = 20
STEP = se3.exp(np.array([0.05, 0.01, 0.08, 0.02, 0.05, -0.03]))
DISPLACED = se3.exp(np.array([0.01, -0.006, 0.008, 0.003, 0.004, -0.005]))
BACK = se3.inverse(DISPLACED)
NO_TILT = np.zeros(2)
TILT = np.array([0.02, -0.01])


def walk(shared, tilt=NO_TILT):
    """A map of three key frames a `STEP` apart with landmarks of their own, each with `shared` ones of the first.

    Depth is measured with a `tilt`.
    """
    rng, map_ = np.random.default_rng(0), Map()
    T_map_camera = [np.eye(4), STEP, STEP @ STEP]
    first = points_ahead(rng, 80)
    for number, T in enumerate(T_map_camera):
        view = blank_view(number)
        corners = exact(project(np.eye(4), points_ahead(rng, OWN) if number else first))
        known = MeasuredLandmarks.nothing()
        if number:
            rows = np.arange(shared)
            seen = project(se3.inverse(T), map_.landmarks.position[rows])
            seen[:, 2] /= 1.0 + seen[:, :2] @ tilt
            known = MeasuredLandmarks(rows, np.full((shared, 2), 30.0), exact(seen))
        uv = np.full((len(corners), 2), 30.0)
        against = number - 1 if number else None
        keyframe = map_.add_keyframe(view, se3.inverse(T), known, ShutterTiming(), against, 1e-6 * np.eye(6))
        map_.add_corners(keyframe, view, Corners(uv, corners), np.zeros(2))
    return map_, np.array([se3.inverse(T) for T in T_map_camera])


@pytest.mark.parametrize(
    ("shared", "T_old_new", "tilt"), [(60, np.eye(4), NO_TILT), (60, BACK, NO_TILT), (60, BACK, TILT), (5, BACK, TILT)]
)
def test_they_are_where_the_landmarks_of_older_ones_show_them_and_take_their_own_along(shared, T_old_new, tilt):
    map_, true = walk(shared, tilt)
    L = map_.landmarks
    own = [np.flatnonzero(L.alive & (L.keyframe == k)) for k in (1, 2)]
    where = [L.position[rows].copy() for rows in own]
    for k in (1, 2):  # the old lens or tilt had displaced them all
        rows = own[k - 1]
        map_.move_keyframes(np.array([k]), (true[k] @ DISPLACED)[None], rows)
        L.position[rows] = se3.apply(se3.inverse(true[k] @ DISPLACED) @ true[k], L.position[rows])
    carry_newer(map_, map_.keyframes[0], T_old_new)
    refit_newer(map_, map_.keyframes[0], ShutterTiming(), tilt)
    for k in (1, 2):
        np.testing.assert_allclose(map_.keyframes[k].T_camera_map, true[k], atol=1e-5)
        np.testing.assert_allclose(L.position[own[k - 1]], where[k - 1], atol=1e-4)


def test_carried_along_they_are_where_they_were_as_seen_from_the_newest_adjusted_one():
    map_, true = walk(5)
    L = map_.landmarks
    own = [np.flatnonzero(L.alive & (L.keyframe == k)) for k in (1, 2)]
    seen = [se3.apply(true[k], L.position[own[k - 1]]) for k in (1, 2)]
    map_.move_keyframes(np.array([0]), (true[0] @ DISPLACED)[None])
    carry_newer(map_, map_.keyframes[0], DISPLACED)
    for k in (1, 2):
        T_camera_map = map_.keyframes[k].T_camera_map
        T_first_map = map_.keyframes[0].T_camera_map
        np.testing.assert_allclose(T_camera_map @ se3.inverse(T_first_map), true[k], atol=1e-9)
        np.testing.assert_allclose(se3.apply(T_camera_map, L.position[own[k - 1]]), seen[k - 1], atol=1e-9)


def test_the_registrations_say_what_the_poses_do():
    map_, _ = walk(60)
    map_.move_keyframes(np.array([2]), (map_.keyframes[2].T_camera_map @ DISPLACED)[None])
    refit_newer(map_, map_.keyframes[0], ShutterTiming(), NO_TILT)
    edge = map_.registrations.of(2)[0]
    a, b = (map_.keyframes[k].T_camera_map for k in (edge.a, edge.b))
    np.testing.assert_allclose(edge.T_a_b, a @ se3.inverse(b), atol=1e-9)
