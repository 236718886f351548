"""Clock offset and hand-eye of a whole simulated session, as `odom run` reports them, against what was simulated."""

import json
import subprocess
import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from odom.evaluation import Trajectory, evaluate
from odom.evaluation.files import read_tum
from odom.evaluation.mocap_calibration import calibrate
from odom.evaluation.truth_noise import truth_noise
from odom.geometry import se3
from sensors.arena.camera_path import make_walk
from sensors.arena.motion_capture import T_camera_marker
from sensors.arena.options import ArenaOptions

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

OPTIONS = ArenaOptions()


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """The folder that the default session leaves, and the report in it."""
    folder = tmp_path_factory.mktemp("session")
    command = [sys.executable, "-m", "odom", "run", "arena", "--headless", "--out", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=500, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return folder, json.loads((folder / "report.json").read_text())


def hand_eye_error(report):
    found = np.eye(4)
    found[:3, :3] = Rotation.from_quat(report["hand_eye"]["quaternion_xyzw"]).as_matrix()
    found[:3, 3] = report["hand_eye"]["translation_m"]
    return se3.log(se3.inverse(found) @ se3.inverse(T_camera_marker(OPTIONS)))


def test_clock_offset_and_hand_eye_rotation_are_those_simulated(session):
    _, report = session
    assert abs(report["time_offset_s"] - OPTIONS.mocap_offset_s) < 0.002
    assert np.degrees(np.linalg.norm(hand_eye_error(report)[3:])) < 0.3


def test_hand_eye_translation_is_that_simulated(session):
    _, report = session
    assert np.linalg.norm(hand_eye_error(report)[:3]) < 0.003


def test_ate_is_that_with_exact_truth_and_the_noise_of_motion_capture(session):
    folder, report = session
    estimate = read_tum(folder / "trajectory.txt")
    times = (estimate.stamps - OPTIONS.start) * 1e-9
    walk = make_walk(OPTIONS)
    exact = Trajectory(estimate.stamps, np.array([walk.T_world_camera(t) for t in times]))
    truth = read_tum(folder / "truth.txt").delayed(-report["time_offset_s"])
    judged = estimate.take(truth.at(estimate.stamps, 0.1)[1])
    assert len(judged) == report["matched"]
    noise = truth_noise(truth)
    assert noise is not None
    reach_m = np.linalg.norm(T_camera_marker(OPTIONS)[:3, 3])  # the marker's turn moves the camera
    variance_m2 = np.trace(noise.interpolated_covariance[:3, :3])
    variance_m2 += 2.0 * reach_m**2 * noise.interpolated_covariance[3, 3]
    exact_m = evaluate(judged, calibrate(judged, exact).camera_truth(exact)).ate_m  # as the run calibrates its truth
    print(f"ATE {report['ate_m']:.6f} m, by exact truth {exact_m:.6f}, noise {variance_m2**0.5:.6f}")
    assert report["ate_m"] == pytest.approx(np.sqrt(exact_m**2 + variance_m2), rel=0.05)
