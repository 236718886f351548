"""Corners followed from one blurred image to the next, where patches out of sharp images are found no more."""

import cv2
import numpy as np
import pytest
from painted_room import SMALL, PaintedRoom

from odom.backend.chain.chain_frame import ChainFrame
from odom.backend.chain.followed_corners import follow_corners
from odom.backend.chain.named_features import NamedFeatures
from odom.backend.chain.own_corners import cut_corners
from odom.backend.chain.pairwise import PairwisePose, register_frames
from odom.backend.odometry.unproven_sensor import unproven_sensor
from odom.backend.settings import OdometrySettings
from odom.frontend.features.images import FrameImages
from odom.frontend.features.view import View
from odom.geometry import se3

BLUR_PX = 15
TURN = np.array([0.01, 0.0, 0.0, 0.0, 0.09, 0.0])
"""Motion from frame to frame: 2.7 rad/s at 30 Hz."""
NOWHERE = np.zeros((0, 2))


def blurred(grey):
    return cv2.blur(grey, (BLUR_PX, 1))


@pytest.fixture
def turning():
    """The sensor, a sharp frame, and two blurred ones, each a turn further; all with the middle row for all rows."""
    room, sensor = PaintedRoom(contrast=6.0), unproven_sensor(SMALL, OdometrySettings())
    frames = []
    for k, look in enumerate((lambda grey: grey, blurred, blurred)):
        frame = room.frame(SMALL, k, se3.exp(k * TURN))
        sensor = sensor.with_stamp(frame.stamp)
        view = View.of(frame, k, sensor.clock, FrameImages.of(look(frame.color)))
        frames.append(ChainFrame(view, NamedFeatures.nothing(), np.zeros(6), None))
    return sensor, frames


def test_two_images_blurred_alike_show_corners_that_a_sharp_patch_no_longer_finds(turning):
    sensor, (sharp, first, second) = turning
    corners, _ = cut_corners(sharp.view, NOWHERE, np.eye(4), -1, np.zeros(6), sensor)
    by_patches = corners.look_for(second.view, se3.inverse(se3.exp(2 * TURN)), np.zeros(6), sensor)
    before, now = follow_corners(first, second, NOWHERE, se3.exp(TURN), -1, sensor)
    assert len(now) > 2 * len(by_patches)
    found = register_frames(before.measured, now.measured, se3.exp(TURN))
    assert isinstance(found, PairwisePose)
    error = se3.log(se3.inverse(found.T_previous_current) @ se3.exp(TURN))
    assert np.linalg.norm(error[:3]) < 0.01
    assert np.linalg.norm(error[3:]) < 0.005


def test_both_sights_name_the_same_corners_each_by_a_name_of_its_own(turning):
    sensor, (_, first, second) = turning
    before, now = follow_corners(first, second, NOWHERE, se3.exp(TURN), -7, sensor)
    np.testing.assert_array_equal(before.names, now.names)
    assert len(np.unique(now.names)) == len(now)
    assert now.names.max() <= -7
    assert (np.diff(now.names) < 0).all()


def test_known_features_are_not_followed_once_more(turning):
    sensor, (_, first, second) = turning
    before, _ = follow_corners(first, second, NOWHERE, se3.exp(TURN), -1, sensor)
    again, _ = follow_corners(first, second, before.uv, se3.exp(TURN), -1, sensor)
    apart = np.linalg.norm(before.uv[:, None] - again.uv, axis=2) if len(again) else np.full((1, 1), np.inf)
    assert apart.min() > 5.0


def test_where_the_hint_leads_out_of_the_image_nothing_is_found(turning):
    sensor, (_, first, second) = turning
    away = se3.exp(np.array([0.0, 0.0, 0.0, 0.0, 2.0, 0.0]))
    before, now = follow_corners(first, second, NOWHERE, away, -1, sensor)
    assert len(before) == len(now) == 0
