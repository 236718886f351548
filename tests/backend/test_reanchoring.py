"""A landmark that is handed to another key frame looks there as if that one had seen it first."""

import numpy as np
import pytest
from painted_room import SMALL, PaintedRoom

from odom.backend.map.reanchoring import joined, seen_from, take
from odom.backend.map.saved import SavedLandmarks
from odom.frontend.features.image_scale import scaled_lens
from odom.frontend.features.images import FrameImages
from odom.frontend.features.patches import cut_patches
from odom.geometry import se3

ROOM, LENS = PaintedRoom(3), scaled_lens(SMALL)
FRONT_M = 2.0
"""The wall ahead, seen from the middle of the room."""


def wall_seen(T_room_camera, uv):
    """Inverse depth of the front wall at pixels, and its slopes (n x 3): it is flat, so differences are exact."""

    def inverse_depth(at):
        rays = np.column_stack([(at - LENS.intrinsics[2:]) / LENS.intrinsics[:2], np.ones(len(at))])
        ahead = rays @ T_room_camera[2, :3]
        return ahead / (FRONT_M - T_room_camera[2, 3])

    w = inverse_depth(uv)
    return np.column_stack([w, inverse_depth(uv + np.eye(2)[0]) - w, inverse_depth(uv + np.eye(2)[1]) - w])


def landmarks_of(T_room_camera, uv, identity):
    images = FrameImages.of(ROOM.render(SMALL, T_room_camera)[0])
    plane = wall_seen(T_room_camera, uv)
    rays = np.column_stack([(uv - LENS.intrinsics[2:]) / LENS.intrinsics[:2], np.ones(len(uv))])
    counts = np.arange(len(uv))
    return SavedLandmarks(
        identity, rays / plane[:, :1], np.tile(1e-4 * np.diag([1.0, 2.0, 3.0]), (len(uv), 1, 1)), uv, plane,
        cut_patches(images.full, uv), cut_patches(images.half, uv / 2.0), counts, counts, counts % 2 == 0,
    )  # fmt: skip


def ahead(number=60, seed=0):
    return np.random.default_rng(seed).uniform([180.0, 140.0], [460.0, 340.0], (number, 2))


@pytest.mark.parametrize(
    "motion", [(0.1, 0.05, 0.0, 0, 0, 0), (0, 0, 0.2, 0, 0, 0.3), (0.2, 0, 0.1, 0.05, -0.15, 0.1), (0, 0, 0, 0, 0, 0)]
)
def test_it_looks_as_if_seen_there_first(motion):
    old, new = np.eye(4), se3.exp(np.array(motion, dtype=float))
    uv = ahead()
    found = seen_from(landmarks_of(old, uv, np.arange(1, 61)), se3.inverse(new), LENS)
    assert len(found.identity) > 40
    expected = landmarks_of(new, found.uv, found.identity)
    np.testing.assert_allclose(found.position, expected.position, atol=1e-9)
    np.testing.assert_allclose(found.plane, expected.plane, atol=1e-6)
    inner = np.s_[:, 6:-6, 6:-6]  # an aligned patch has 13 pixels; farther out the old one may end
    for name, share in (("patch_full", 0.06), ("patch_half", 0.12)):  # what a surface bends over twice the width
        now, true = getattr(found, name)[inner].astype(float), getattr(expected, name)[inner]
        assert np.sqrt(((now - true) ** 2).mean()) < share * true.std()
    T_new_old = se3.inverse(new)
    np.testing.assert_allclose(
        found.covariance[0], T_new_old[:3, :3] @ (1e-4 * np.diag([1.0, 2.0, 3.0])) @ T_new_old[:3, :3].T, atol=1e-12
    )
    np.testing.assert_array_equal(found.seen, found.identity - 1)


def test_what_the_other_does_not_see_is_left_out():
    landmarks = landmarks_of(np.eye(4), ahead(), np.arange(1, 61))
    for motion in ((0, 0, 0, 0, 3.0, 0), (0, 0, 1.9, 0, 0, 0), (5.0, 0, 0, 0, 0, 0)):
        assert len(seen_from(landmarks, se3.inverse(se3.exp(np.array(motion, dtype=float))), LENS).identity) == 0


def test_taking_and_joining_keep_every_field_together():
    landmarks = landmarks_of(np.eye(4), ahead(6), np.arange(1, 7))
    is_even = landmarks.identity % 2 == 0
    both = joined(take(landmarks, is_even), take(landmarks, ~is_even))
    order = np.argsort(both.identity)
    np.testing.assert_array_equal(both.uv[order], landmarks.uv)
    np.testing.assert_array_equal(both.patch_half[order], landmarks.patch_half)
