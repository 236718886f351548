"""The desk's truth is said to be the camera's own: what clock offset and hand-eye are found, and whose they are."""

import json
import subprocess
import sys
from itertools import product

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from sensors.calibration_file import load_calibration
from sensors.tum import read_list

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

GAPS_S = (0.2, 0.35, 0.5, 0.7)
LEAST_TURN_RAD = np.deg2rad(4.0)


def odom(*arguments):
    done = subprocess.run([sys.executable, "-m", "odom", *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.fixture(scope="module", params=["tum_fr1_xyz", "tum_fr1_rpy_part"])
def judged(request, shared_data, tmp_path_factory):
    """The recording's folder, the report of its run, and the figures with offset and hand-eye estimated."""
    folder, out = shared_data / request.param, tmp_path_factory.mktemp(request.param)
    odom("run", folder, "--headless", "--out", out)
    asked = ["--time-offset", "auto", "--hand-eye", "auto", "--json", out / "figures.json"]
    odom("eval", out / "trajectory.txt", folder / "groundtruth.txt", *asked)
    figures = json.loads((out / "figures.json").read_text())
    print(request.param, {key: figures[key] for key in ("time_offset_s", "hand_eye", "ate_m")})
    return folder, json.loads((out / "report.json").read_text()), figures


def body_from_camera(figures):
    return Rotation.from_quat(figures["hand_eye"]["quaternion_xyzw"])


def test_neither_is_estimated_unless_asked_for(judged):
    _, report, _ = judged
    assert report["time_offset_s"] is None
    assert report["hand_eye"] is None


def test_the_clocks_differ_by_less_than_ten_milliseconds(judged):
    _, _, figures = judged
    assert abs(figures["time_offset_s"]) < 0.010


@pytest.mark.xfail(reason="the truth is turned by more than a degree against the colour camera, see the next test")
def test_the_truth_is_the_cameras_own(judged):
    _, _, figures = judged
    assert np.linalg.norm(figures["hand_eye"]["translation_m"]) < 0.010
    assert np.rad2deg(body_from_camera(figures).magnitude()) < 1.0


def test_how_the_truth_is_turned_shows_without_the_odometry(judged):
    """OpenCV's features and PnP between single frames find the same turn about the camera's x and y axes.

    About z, and in translation, a rolling shutter that nothing corrects for spoils them.
    """
    folder, _, figures = judged
    turns_camera, turns_truth = relative_rotations(folder, figures["time_offset_s"])
    kept = np.linalg.norm(turns_truth, axis=1) > LEAST_TURN_RAD
    for _ in range(5):
        camera_from_truth = Rotation.align_vectors(turns_camera[kept], turns_truth[kept])[0]
        away = np.linalg.norm(turns_camera - camera_from_truth.apply(turns_truth), axis=1)
        kept = (np.linalg.norm(turns_truth, axis=1) > LEAST_TURN_RAD) & (away < 3 * np.median(away[kept]))
    alone = np.rad2deg(camera_from_truth.as_rotvec())
    ours = np.rad2deg(body_from_camera(figures).inv().as_rotvec())
    print({"pairs": int(kept.sum()), "PnP alone, deg": alone.round(2), "odometry, deg": ours.round(2)})
    assert np.linalg.norm(alone[:2]) > 1.0
    assert np.linalg.norm((alone - ours)[:2]) < 0.6


def relative_rotations(folder, offset_s):
    """Return the camera's turns between pairs of frames as rotation vectors (n x 3), by PnP and by the truth."""
    camera = load_calibration(folder / "camera.yaml").camera
    poses = [(entry.stamp * 1e-9, *map(float, entry.values)) for entry in read_list(folder / "groundtruth.txt", 7)]
    truth = np.array(poses)
    true = Slerp(truth[:, 0] - offset_s, Rotation.from_quat(truth[:, 4:8]))
    colors, depths = read_list(folder / "rgb.txt", 1)[::2], read_list(folder / "depth.txt", 1)
    stamps = np.array([entry.stamp * 1e-9 for entry in colors])
    depth_stamps = np.array([entry.stamp * 1e-9 for entry in depths])
    sift = cv2.SIFT_create(1200)
    seen = []
    for entry, stamp in zip(colors, stamps, strict=True):
        nearest = depths[int(np.abs(depth_stamps - stamp).argmin())]
        depth_m = cv2.imread(str(folder / nearest.values[0]), cv2.IMREAD_UNCHANGED) / 5000.0
        corners, looks = sift.detectAndCompute(cv2.imread(str(folder / entry.values[0]), cv2.IMREAD_GRAYSCALE), None)
        seen.append((np.array([corner.pt for corner in corners]), looks, depth_m))
    by_pnp, by_truth = [], []
    for i, gap_s in product(range(len(seen)), GAPS_S):
        j = int(np.abs(stamps - stamps[i] - gap_s).argmin())
        turn = turn_between(seen[i], seen[j], camera) if i < j and stamps[j] < true.times[-1] else None
        if turn is not None:
            by_pnp.append(turn)
            by_truth.append((true(stamps[i]).inv() * true(stamps[j])).as_rotvec())
    return np.array(by_pnp), np.array(by_truth)


def turn_between(a, b, camera):
    """Return the rotation vector of the camera at `b` in the camera at `a`, None where too little matches."""
    (uv_a, looks_a, depth_m), (uv_b, looks_b, _) = a, b
    K, distortion = camera.matrix, np.array(camera.distortion)
    pairs = [
        first
        for first, second in cv2.BFMatcher().knnMatch(looks_a, looks_b, 2)
        if first.distance < 0.75 * second.distance
    ]
    uv_a, uv_b = uv_a[[pair.queryIdx for pair in pairs]], uv_b[[pair.trainIdx for pair in pairs]]
    columns, rows = np.rint(uv_a).astype(int).T
    z = depth_m[rows.clip(0, camera.height - 1), columns.clip(0, camera.width - 1)]
    near = (z > 0.3) & (z < 4.0)
    if np.count_nonzero(near) < 40:
        return None
    rays = cv2.undistortPoints(uv_a[near].reshape(-1, 1, 2), K, distortion).reshape(-1, 2)
    points, uv = np.column_stack([rays, np.ones(len(rays))]) * z[near, None], uv_b[near]
    ok, turn, shift, inliers = cv2.solvePnPRansac(points, uv, K, distortion, reprojectionError=2.0, iterationsCount=300)
    if not ok or len(inliers) < 30:
        return None
    turn, _ = cv2.solvePnPRefineLM(points[inliers[:, 0]], uv[inliers[:, 0]], K, distortion, turn, shift)
    return -turn[:, 0]
