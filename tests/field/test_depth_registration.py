"""Software registration of depth to colour, against surfaces whose depth is known in closed form."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from odom.errors import ConfigError
from odom.frame import Camera
from sensors.depth_registration import DepthRegistration, load_depth_registration

DEPTH = Camera(640, 480, 580.0, 582.0, 314.0, 243.0)
COLOR = Camera(640, 480, 525.0, 526.0, 320.5, 238.0)


def extrinsic(degrees: float = 1.0) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(np.deg2rad(degrees) * np.array([0.3, -0.8, 0.5])).as_matrix()
    T[:3, 3] = (0.025, -0.002, 0.004)
    return T


def plane_depth(camera: Camera, normal: np.ndarray, distance: float) -> np.ndarray:
    """Depth in m along the optical axis of the plane normal . X = distance, seen by an undistorted camera."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u, dtype=float)], axis=-1)
    return distance / (rays @ normal)


def in_color(T: np.ndarray, normal: np.ndarray, distance: float) -> tuple[np.ndarray, float]:
    rotated = T[:3, :3] @ normal
    return rotated, distance + rotated @ T[:3, 3]


@pytest.mark.parametrize("degrees", [0.0, 1.0, 4.0])
def test_a_slanted_plane_is_where_the_colour_camera_sees_it_without_holes(degrees: float) -> None:
    T = extrinsic(degrees)
    normal = np.array([0.2, -0.1, 1.0]) / np.linalg.norm([0.2, -0.1, 1.0])
    seen = np.round(plane_depth(DEPTH, normal, 1.5) * 1e3).astype(np.uint16)
    registered = DepthRegistration(DEPTH, COLOR, T)(seen)
    expected = plane_depth(COLOR, *in_color(T, normal, 1.5)) * 1e3
    # The depth camera's narrower view ends inside the image; within it nothing is missing.
    inside = np.zeros(seen.shape, dtype=bool)
    inside[110:370, 110:530] = True
    assert (registered[inside] > 0).all()
    assert np.abs(registered[inside] - expected[inside]).max() < 3.0


@pytest.mark.parametrize("roll", [20.0, 45.0, 90.0, 180.0, -135.0])
def test_depth_of_a_camera_that_is_rolled_against_colour_has_no_holes(roll: float) -> None:
    T = extrinsic(0.0)
    T[:3, :3] = Rotation.from_euler("z", roll, degrees=True).as_matrix()
    seen = np.full((480, 640), 1500, dtype=np.uint16)
    middle = DepthRegistration(DEPTH, COLOR, T)(seen)[120:360, 200:440]
    assert (middle == 1504).all()


def test_the_nearer_surface_hides_the_farther() -> None:
    depth = np.full((480, 640), 3000, dtype=np.uint16)
    depth[200:280, 280:360] = 1000
    T = extrinsic(0.0)
    registered = DepthRegistration(DEPTH, COLOR, T)(depth)
    corner = np.array([(280 - DEPTH.cx) / DEPTH.fx, (200 - DEPTH.cy) / DEPTH.fy, 1.0]) + T[:3, 3]
    u, v = COLOR.fx * corner[0] / corner[2] + COLOR.cx, COLOR.fy * corner[1] / corner[2] + COLOR.cy
    assert registered[round(v) + 10, round(u) + 10] == 1004
    assert registered[round(v) - 10, round(u) - 10] in (0, 3004)


def test_distortion_of_both_lenses_is_followed() -> None:
    import cv2

    depth_camera = Camera(640, 480, 580.0, 582.0, 314.0, 243.0, (-0.08, 0.1, 0.001, -0.001, 0.0))
    color_camera = Camera(640, 480, 525.0, 526.0, 320.5, 238.0, (0.2, -0.4, 0.002, 0.001, 0.1))
    T = extrinsic()
    depth = np.zeros((480, 640), dtype=np.uint16)
    for u, v in [(60, 50), (320, 240), (580, 430)]:
        depth[:] = 0
        depth[v, u] = 2000
        registered = DepthRegistration(depth_camera, color_camera, T)(depth)
        pixel = np.array([[[u, v]]], dtype=float)
        ray = cv2.undistortPoints(pixel, depth_camera.matrix, np.array(depth_camera.distortion)).ravel()
        point = T[:3, :3] @ (2.0 * np.array([*ray, 1.0])) + T[:3, 3]
        expected = cv2.projectPoints(
            point[None], np.zeros(3), np.zeros(3), color_camera.matrix, np.array(color_camera.distortion)
        )[0].ravel()
        rows, columns = np.nonzero(registered)
        assert len(rows)
        assert np.hypot(columns.mean() - expected[0], rows.mean() - expected[1]) < 1.0
        assert registered[rows[0], columns[0]] == pytest.approx(1e3 * point[2], abs=1.5)


def test_unknown_depth_stays_unknown_and_a_half_size_depth_image_fills_the_colour_image() -> None:
    half = Camera(320, 240, 290.0, 291.0, 157.0, 121.0)
    registered = DepthRegistration(half, COLOR, np.eye(4))(np.full((240, 320), 2000, dtype=np.uint16))
    assert (registered[120:360, 160:480] == 2000).all()
    assert not DepthRegistration(DEPTH, COLOR, extrinsic())(np.zeros((480, 640), dtype=np.uint16)).any()


def test_the_calibration_file_says_it(tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    depth = {"image_width": 640, "image_height": 480, "camera_matrix": {"data": [580, 0, 314, 0, 582, 243, 0, 0, 1]}}
    content = {"depth_camera": depth, "T_color_depth": {"data": extrinsic().ravel().tolist()}}
    file.write_text(yaml.safe_dump(content))
    found = load_depth_registration(file, COLOR)
    assert found is not None
    assert found.depth_camera == DEPTH
    file.write_text(yaml.safe_dump({"image_width": 640}))
    assert load_depth_registration(file, COLOR) is None
    file.write_text(yaml.safe_dump(content | {"T_color_depth": {"data": [1, 2, 3]}}))
    with pytest.raises(ConfigError, match="T_color_depth"):
        load_depth_registration(file, COLOR)
    file.write_text(yaml.safe_dump(content | {"T_color_depth": {"data": (2 * np.eye(4)).ravel().tolist()}}))
    with pytest.raises(ConfigError, match="rigid"):
        load_depth_registration(file, COLOR)


DEPTH_YAML = {"image_width": 640, "image_height": 480, "camera_matrix": {"data": [580, 0, 314, 0, 582, 243, 0, 0, 1]}}
SHIFTED = [1, 0, 0, 0.025, 0, 1, 0, 0, 0, 0, 1, 0]


@pytest.mark.parametrize(
    ("depth_camera", "transform", "named"),
    [
        ({"camera_matrix": {"data": [525, 525, 319, 239]}}, None, "camera_matrix has 4 values"),
        ({"camera_matrix": {"data": [0, 0, 314, 0, 582, 243, 0, 0, 1]}}, None, "depth_camera"),
        ({"camera_matrix": {"data": [580, 0, float("nan"), 0, 582, 243, 0, 0, 1]}}, None, "depth_camera"),
        ({"camera_matrix": [580, 0, 314, 0, 582, 243, 0, 0, 1]}, None, "depth_camera"),
        ({"image_width": float("inf")}, None, "depth_camera"),
        ({"distortion_coefficients": {"data": ["none"] * 5}}, None, "depth_camera"),
        ({"distortion_coefficients": {"data": [0.1, 0.2, 0.3]}}, None, "3 distortion coefficients"),
        ({"distortion_coefficients": None}, None, "depth_camera"),
        ({"distortion_model": "equidistant"}, None, "equidistant"),
        ({}, [*SHIFTED[:3], float("nan"), *SHIFTED[4:], 0, 0, 0, 1], "rigid"),
        ({}, [*SHIFTED, 0, 0, 0.025, 1], "rigid"),
        ({}, ["one", *SHIFTED[1:], 0, 0, 0, 1], "T_color_depth"),
    ],
)
def test_whatever_is_malformed_is_refused_by_name(
    tmp_path: Path, depth_camera: dict[str, object], transform: list[float] | None, named: str
) -> None:
    file = tmp_path / "camera.yaml"
    data = transform or extrinsic().ravel().tolist()
    file.write_text(yaml.safe_dump({"depth_camera": DEPTH_YAML | depth_camera, "T_color_depth": {"data": data}}))
    with pytest.raises(ConfigError, match=named) as refused:
        load_depth_registration(file, COLOR)
    assert str(file) in str(refused.value)


def test_a_depth_image_that_is_not_the_depth_cameras_is_refused() -> None:
    small = Camera(512, 424, 365.0, 365.0, 255.0, 211.0)
    with pytest.raises(ConfigError, match="512x424"):
        DepthRegistration(small, COLOR, extrinsic())(np.full((480, 640), 1000, dtype=np.uint16))
