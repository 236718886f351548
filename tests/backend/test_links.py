"""Key frames that hardly see anything, as behind a crowd, stay in touch with those that hold what they see."""

import numpy as np
from made_up_scene import NO_DEPTH, points_ahead, project
from test_newer_keyframes import exact

from odom.backend.map.corners import Corners
from odom.backend.map.keyframe import MeasuredLandmarks
from odom.backend.map.map import Map
from odom.frame import Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.images import FrameImages
from odom.frontend.features.view import View

SEEN = 10
"""Landmarks of the first key frame that each later one still sees: fewer than link two of them otherwise."""


def test_key_frames_that_see_few_landmarks_do_not_cut_the_camera_off_from_them() -> None:
    rng, map_ = np.random.default_rng(0), Map()
    images = FrameImages.of(np.zeros((48, 64), np.uint8))
    for number in range(8):
        view = View(number, number, Stamp(33_000_000 * number), SteadyStamp(0), images, Stamp(0), NO_DEPTH)
        known, against = MeasuredLandmarks.nothing(), None
        if number:
            rows, against = np.arange(SEEN), number - 1
            seen = exact(project(np.eye(4), map_.landmarks.position[rows]))
            known = MeasuredLandmarks(rows, np.full((SEEN, 2), 30.0), seen)
        keyframe = map_.add_keyframe(view, np.eye(4), known, ShutterTiming(), against, 1e-6 * np.eye(6))
        if not number:
            corners = exact(project(np.eye(4), points_ahead(rng, 60)))
            map_.add_corners(keyframe, view, Corners(np.full((60, 2), 30.0), corners), np.zeros(2))
    assert 0 in map_.around(7, 10)
