"""Which of several motions in one view is the camera's."""

import numpy as np
import pytest
from made_up_scene import points_ahead, project

from odom.backend.tracking.consensus import consensus, triples_needed
from odom.backend.tracking.expected_pose import ExpectedPose
from odom.backend.tracking.tuning import TUNING
from odom.backend.tracking.voting_features import VotingFeatures
from odom.geometry import se3

ANYWHERE = ExpectedPose(np.eye(4), np.full(2, np.inf))
PIXEL = 1.0 / 525.0
CAMERA = se3.exp(np.array([0.004, -0.01, 0.012, 0.004, 0.006, -0.002]))
BODY = se3.exp(np.array([-0.05, 0.01, 0.0, 0.0, 0.01, 0.0])) @ CAMERA
"""T_camera_map as the body's own features show it: it went five centimetres."""


SLOW_BODY = se3.exp(np.array([-0.008, 0.0, 0.0, 0.0, 0.0, 0.0])) @ CAMERA
"""The same of a body that went 8 mm: where it puts the camera, most of the scene is off by 1 to 3 pixels."""


def two_motions(rng, scene: int, body: int, seen_on_body: int = 8, T_body=BODY) -> VotingFeatures:
    """Features of a scene all over the image, and of a body in its middle, whose points lie close together."""
    points = points_ahead(rng, scene + body)
    rays = np.column_stack([rng.uniform(-0.12, 0.12, body), rng.uniform(-0.35, 0.35, body)])
    points[scene:] = np.column_stack([rays, np.ones(body)]) * rng.uniform(0.9, 1.0, (body, 1))
    seen = np.concatenate([project(CAMERA, points[:scene]), project(T_body, points[scene:])])[:, :2]
    seen += 0.3 * PIXEL * rng.normal(size=seen.shape)
    uv = np.array([319.5, 239.5]) + seen / PIXEL
    counts = np.concatenate([np.full(scene, 8), np.full(body, seen_on_body)])
    return VotingFeatures(points, np.zeros(3), seen, uv, counts, 1.0, PIXEL)


@pytest.mark.parametrize("seed", range(5))
def test_the_motion_that_shows_all_over_the_image_is_taken_for_the_cameras(seed: int) -> None:
    features = two_motions(np.random.default_rng(seed), scene=80, body=90)
    T = consensus(features, BODY, ANYWHERE)
    assert T is not None
    assert np.abs(se3.log(T @ se3.inverse(CAMERA))).max() < 2e-3


@pytest.mark.parametrize("seed", range(5))
def test_a_slow_body_is_not_followed_where_the_scene_has_twice_its_votes(seed: int) -> None:
    features = two_motions(np.random.default_rng(seed), scene=48, body=40, T_body=SLOW_BODY)
    assert np.count_nonzero(features.off_px(SLOW_BODY) > TUNING.differs_px) < TUNING.contested_least
    T = consensus(features, SLOW_BODY, ANYWHERE)
    assert T is not None
    assert np.abs(se3.log(T @ se3.inverse(CAMERA))).max() < 3e-3


def test_the_cameras_own_motion_is_not_left_for_a_bodys() -> None:
    features = two_motions(np.random.default_rng(0), scene=80, body=90)
    assert consensus(features, CAMERA, ANYWHERE) is None


def test_a_single_motion_has_no_rival() -> None:
    features = two_motions(np.random.default_rng(0), scene=120, body=0)
    assert consensus(features, CAMERA, ANYWHERE) is None


def test_a_motion_without_a_jerk_wins_against_more_features() -> None:
    features = two_motions(np.random.default_rng(1), scene=22, body=200)
    assert consensus(features, BODY, ANYWHERE) is None
    T = consensus(features, BODY, ExpectedPose.after(np.eye(4), 1 / 30.0))
    assert T is not None
    assert np.abs(se3.log(T @ se3.inverse(CAMERA))).max() < 3e-3


def test_a_hand_can_quicken_a_turn_but_does_not_throw_the_camera() -> None:
    expected = ExpectedPose.after(CAMERA, 1 / 30.0)
    assert expected.is_within_reach(se3.exp(np.array([0.005, 0.0, 0.0, 0.0, 0.04, 0.0])) @ CAMERA)
    assert not expected.is_within_reach(BODY)
    assert ExpectedPose.after(CAMERA, 0.2).is_within_reach(BODY)  # in a slow stream nobody knows


def test_landmarks_that_are_new_count_less_than_old_ones() -> None:
    features = two_motions(np.random.default_rng(1), scene=40, body=200, seen_on_body=1)
    T = consensus(features, BODY, ANYWHERE)
    assert T is not None
    assert np.abs(se3.log(T @ se3.inverse(CAMERA))).max() < 3e-3


def test_a_pose_is_contested_by_many_that_disagree_not_by_a_few() -> None:
    features = two_motions(np.random.default_rng(1), scene=200, body=0)
    assert features.is_contested(CAMERA, np.arange(200) < 60)
    assert not features.is_contested(CAMERA, np.arange(200) < 20)
    few = two_motions(np.random.default_rng(1), scene=40, body=0)
    assert not few.is_contested(CAMERA, np.arange(40) < 10)


def test_a_scene_that_shows_in_few_features_contests_the_pose_of_a_small_body_rich_in_texture() -> None:
    features, is_scene = two_motions(np.random.default_rng(1), scene=30, body=200), np.arange(230) < 30
    assert features.is_contested(BODY, is_scene)
    assert not features.is_contested(CAMERA, is_scene)  # it is hardly off
    assert not features.is_contested(CAMERA, np.arange(230) >= 200)


def test_the_fewer_votes_are_to_be_beaten_the_more_triples_are_tried_up_to_a_bound() -> None:
    tried = [triples_needed(share) for share in np.linspace(0.0, 1.3, 40)]
    assert tried == sorted(tried, reverse=True)
    assert tried[0] == TUNING.triples
    assert 5 <= tried[-1] <= 15  # even a pose of all features needs some triples, since some of those mislead
