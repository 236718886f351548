"""A Kinect whose depth no driver has registered, as 7-Scenes publishes its images, is tracked nearly as one that is."""

import json
import shutil
import subprocess
import sys
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest

from odom import read_recording
from odom.frame import Camera
from odom.service.run_calibration import calibration_fields
from sensors.calibration_file import load_calibration
from sensors.depth_registration import DepthRegistration
from tests.ran_here import ate_m, run_here

FRAMES = 130
"""Four seconds: fewer hardly show the camera."""
TURN, POSITION_M = (0.003, 0.004, 0.0), (-0.025, 0.0005, -0.002)
"""How the depth camera is mounted beside colour's: not quite as any Kinect's is supposed to be."""


def make_raw(source: Path, folder: Path) -> list[int]:
    """Write a registered recording as raw images of a Kinect, with true poses of its depth camera; return stamps."""
    recording = read_recording(source)
    truth = recording.truth()["camera"]
    T_color_depth = np.eye(4)
    T_color_depth[:3, :3], T_color_depth[:3, 3] = cv2.Rodrigues(np.array(TURN))[0], POSITION_M
    raw = Camera(640, 480, 585.0, 585.0, 320.0, 240.0)
    as_seen_by_depth = DepthRegistration(recording.camera, raw, np.linalg.inv(T_color_depth))
    listed = [line.split() for line in (source / "rgb.txt").read_text().splitlines() if not line.startswith("#")]
    color_file = {1000 * int(stamp.replace(".", "")): file for stamp, file in listed}
    stamps = []
    for i, frame in enumerate(islice(recording, FRAMES)):
        stamps.append(frame.stamp)
        name = folder / f"frame-{i:06}"
        mm = as_seen_by_depth(frame.depth_mm)
        Path(f"{name}.color.png").symlink_to((source / color_file[frame.stamp]).resolve())
        quick = [cv2.IMWRITE_PNG_COMPRESSION, 1]
        cv2.imwrite(f"{name}.depth.png", np.where(mm == 0, 65535, mm).astype(np.uint16), quick)
        nearest = np.argmin(np.abs(truth.stamps - frame.stamp))
        np.savetxt(f"{name}.pose.txt", truth.T_world_body[nearest] @ T_color_depth)
    return stamps


@pytest.mark.long
def test_raw_images_err_at_most_half_as_much_again_as_registered_ones_and_a_calibration_found_in_them_serves(
    shared_data, tmp_path
):
    folder, out = tmp_path / "raw", tmp_path / "first"
    folder.mkdir()
    make_raw(shared_data / "tum_fr1_rpy_part", folder)
    command = [sys.executable, "-m", "odom", "run", folder, "--headless", "--out", out]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=250)
    assert done.returncode == 0, done.stderr
    assert "adjusted by camera-calibrated.yaml" in done.stdout
    first = json.loads((out / "report.json").read_text())
    assert "calibration_kept" not in first
    start, now, _ = first["calibration"]["cy"]
    assert load_calibration(out / "camera-calibrated.yaml").camera.cy == pytest.approx(now, abs=1e-3) != start
    again = read_recording(folder, out / "camera-calibrated.yaml")
    found = run_here(again)
    by_average = (first["completeness"], first["ate_m"], first["calibration_off_px"])
    by_found = (found.completeness, ate_m(found.final, again), found.own.off_px)
    for name, (completeness, error_m, off_px) in (("average Kinect's", by_average), ("found so", by_found)):
        print(f"{name} camera: ATE {error_m:.4f} m, off by {off_px} px")
        assert completeness == 1.0
        assert error_m < 0.0075
    assert by_average[2] > 3.0
    assert by_found[2] < 0.75 * by_average[2]  # eight seconds of turning tell a lens to some pixels


def make_unregistered(source: Path, folder: Path) -> None:
    """Write such raw images as if depth were registered: listed in pairs, with nothing said of another camera."""
    stamps = make_raw(source, folder)
    (folder / "camera.yaml").write_text("depth_scale: 1000\n")
    for name, kind in (("rgb", "color"), ("depth", "depth")):
        lines = (f"{stamp * 1e-9:.6f} frame-{i:06}.{kind}.png\n" for i, stamp in enumerate(stamps))
        (folder / f"{name}.txt").write_text("".join(lines))
    for path in folder.glob("*.pose.txt"):
        path.unlink()
    shutil.copy(source / "groundtruth.txt", folder)


@pytest.mark.long
def test_depth_that_nobody_registered_is_found_to_have_another_focal_length(shared_data, tmp_path):
    folder = tmp_path / "unregistered"
    folder.mkdir()
    make_unregistered(shared_data / "tum_fr1_xyz", folder)
    recording = read_recording(folder)
    found = run_here(recording)
    error_m, calibration = ate_m(found.final, recording), calibration_fields(found.odometry, found.own)["calibration"]
    print(f"ATE {error_m:.4f} m, {calibration}")
    assert found.completeness == 1.0
    assert error_m < 0.006
    for name in ("stretch_u", "stretch_v"):  # 1 - 585 / 517 in the middle; less outside, where colour's lens bends
        assert -0.14 < calibration[name][1] < -0.06
