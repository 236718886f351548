import numpy as np
import pytest
from painted_room import PaintedRoom

from odom.frame import Camera
from odom.frontend.camera.lens import Lens, ray_at
from odom.frontend.features.depth_plane import PLANE_LIMITS, read_planes
from odom.frontend.features.patch_warp import at_half_size, homographies
from odom.frontend.features.patches import PATCH_LIMITS, UNWARPED, align_patches, cut_patches
from odom.geometry import se3

PLAIN = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
BENT = Camera(640, 480, 525.0, 525.0, 319.5, 239.5, (0.12, -0.22, 0.0008, -0.0006, 0.0))


def pose(*xi):
    return se3.exp(np.array(xi, dtype=np.float64))


MOTIONS = {
    "sideways": pose(0.25, 0.0, 0.0, 0.0, -0.1, 0.0),
    "towards": pose(0.0, 0.05, 0.4, 0.0, 0.0, 0.0),
    "away and rolled": pose(0.1, 0.0, -0.4, 0.0, 0.05, 0.35),
}


def seen_patches(camera, T_reference_current):
    """Corners on the walls, their planes, true pixels and the homographies that `homographies` gives."""
    lens, room = Lens.of(camera), PaintedRoom(seed=2, contrast=1.0)
    T_room_reference = pose(0.0, 0.0, -0.5, 0.1, 0.35, 0.0)  # two slanted walls in view
    reference, depth_mm = room.render(camera, T_room_reference)
    current, _ = room.render(camera, T_room_reference @ T_reference_current)
    v, u = np.mgrid[60:430:37, 60:590:41]
    uv = np.column_stack([u.ravel(), v.ravel()]).astype(np.float64)
    plane = read_planes(depth_mm, uv, (0.05, *PLANE_LIMITS[1:]))
    uv, plane = uv[plane[:, 0] > 0], plane[plane[:, 0] > 0]
    z = 1.0 / plane[:, 0]
    points = np.array([[*ray_at(lens.rays, *p), 1.0] for p in uv]) * z[:, None]
    T = se3.inverse(T_reference_current)
    there = lens.project(points, T, 12.0)[:, :2]
    inside = np.isfinite(there[:, 0])
    numbers = np.zeros(inside.sum(), dtype=np.int64)
    H, usable = homographies(uv[inside], plane[inside], numbers, T[None], lens)
    return reference, current, uv[inside], there[inside], H, usable


@pytest.mark.parametrize("camera", [PLAIN, BENT], ids=["pinhole", "bent lens"])
@pytest.mark.parametrize("motion", MOTIONS)
def test_patches_of_slanted_walls_are_found_where_they_truly_are(camera, motion):
    reference, current, uv_reference, truth, H, usable = seen_patches(camera, MOTIONS[motion])
    uv = truth.copy()
    patches, rows = cut_patches(reference, uv_reference), np.arange(len(uv))
    score, _ = align_patches(current, patches, rows, H, uv, usable, 10, 3.0, PATCH_LIMITS)
    found = score > 0.9
    assert found.sum() > 0.6 * len(uv)
    assert np.median(np.linalg.norm(uv - truth, axis=1)[found]) < 0.08
    unwarped, _ = align_patches(
        current, patches, rows, np.tile(UNWARPED, (len(uv), 1, 1)), truth.copy(), usable, 10, 3.0, PATCH_LIMITS
    )
    assert np.mean(1.0 - unwarped[found]) > 4.0 * np.mean(1.0 - score[found])


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_homography_maps_a_patch_to_where_its_surface_was_seen(motion):
    """To a twentieth of a pixel at five pixels from the centre; without its last row it errs by several times that."""
    lens, T = Lens.of(PLAIN), se3.inverse(MOTIONS[motion])
    f, centre = lens.intrinsics[:2], lens.intrinsics[2:]
    rng = np.random.default_rng(3)
    uv, w = rng.uniform((150, 120), (490, 360), (40, 2)), rng.uniform(0.4, 0.8, 40)
    slope = rng.uniform(-0.003, 0.003, (40, 2))
    H, usable = homographies(uv, np.column_stack([w, slope]), np.zeros(40, np.int64), T[None], lens)
    there = se3.apply(T, np.column_stack([(uv - centre) / f, np.ones(40)]) / w[:, None])
    normal = np.column_stack([slope * f, w - np.sum(slope * (uv - centre), axis=1)])  # of n' X = 1
    turned = normal @ T[:3, :3].T
    turned /= (1.0 + turned @ T[:3, 3])[:, None]
    errors = []
    for offset in 5.0 * np.array([[1, 0], [0, 1], [-1, 0], [0, -1], [0.7, 0.7]]):
        seen = there[:, :2] / there[:, 2:] * f + centre + offset
        ray = np.column_stack([(seen - centre) / f, np.ones(40)])
        back = se3.apply(se3.inverse(T), ray / np.sum(turned * ray, axis=1)[:, None])
        truth = back[:, :2] / back[:, 2:] * f + centre - uv
        mapped = offset @ H[:, :2].transpose(0, 2, 1)
        whole = mapped / (1.0 + H[:, 2] @ offset)[:, None]
        errors.append([np.linalg.norm(places - truth, axis=1)[usable] for places in (whole, mapped)])
    exact, affine = np.max(errors, axis=(0, 2))
    assert usable.sum() > 30
    assert exact < 0.05
    assert affine > 4.0 * exact


def test_a_patch_at_half_size_is_warped_alike():
    H, offset = np.array([[[0.9, 0.1], [-0.1, 1.1], [0.002, -0.003]]]), np.array([4.0, -2.0])

    def mapped(H, offset):
        return H[0, :2] @ offset / (1.0 + H[0, 2] @ offset)

    np.testing.assert_allclose(2.0 * mapped(at_half_size(H), offset / 2.0), mapped(H, offset))


def test_no_motion_gives_the_identity():
    lens = Lens.of(BENT)
    uv = np.random.default_rng(0).uniform((30, 30), (600, 440), (50, 2))
    plane = np.tile([0.5, 0.001, -0.0007], (50, 1))
    H, usable = homographies(uv, plane, np.zeros(50, np.int64), np.eye(4)[None], lens)
    assert usable.all()
    np.testing.assert_allclose(H, np.tile(UNWARPED, (50, 1, 1)), atol=1e-3)


def test_surfaces_from_behind_too_near_or_too_far_are_not_used():
    lens = Lens.of(PLAIN)
    uv, plane, first = np.array([[320.0, 240.0]]), np.array([[0.5, 0.0, 0.0]]), np.zeros(1, np.int64)
    for T in (
        pose(0, 0, -1.3, 0, 0, 0),
        pose(0, 0, 6.0, 0, 0, 0),
        pose(0, 0, 0, 0, np.pi, 0),
        pose(0, 0, -2.1, 0, 0, 0),
    ):
        usable = homographies(uv, plane, first, T[None], lens)[1]
        assert not usable.any()
