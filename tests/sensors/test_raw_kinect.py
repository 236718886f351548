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
from sensors.depth_registration import DepthRegistration

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
    stamps = []
    for i, frame in enumerate(islice(recording, FRAMES)):
        stamps.append(frame.stamp)
        name = folder / f"frame-{i:06}"
        mm = as_seen_by_depth(frame.depth_mm)
        cv2.imwrite(f"{name}.color.png", frame.color[..., ::-1])
        cv2.imwrite(f"{name}.depth.png", np.where(mm == 0, 65535, mm).astype(np.uint16))
        nearest = np.argmin(np.abs(truth.stamps - frame.stamp))
        np.savetxt(f"{name}.pose.txt", truth.T_world_body[nearest] @ T_color_depth)
    return stamps


def run(folder: Path, out: Path, *arguments: object) -> dict:
    command = [sys.executable, "-m", "odom", "run", folder, "--headless", "--out", out, *arguments]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=250)
    assert done.returncode == 0, done.stderr
    return json.loads((out / "report.json").read_text())


@pytest.mark.long
def test_raw_images_err_at_most_half_as_much_again_as_registered_ones_and_a_calibration_found_in_them_serves(
    shared_data, tmp_path
):
    folder = tmp_path / "raw"
    folder.mkdir()
    make_raw(shared_data / "tum_fr1_rpy_part", folder)
    first = run(folder, tmp_path / "first")
    again = run(folder, tmp_path / "again", "--camera", tmp_path / "first" / "camera-calibrated.yaml")
    for name, report in (("average Kinect's", first), ("found so", again)):
        print(f"{name} camera: ATE {report['ate_m']:.4f} m, off by {report['calibration_off_px']} px")
        assert report["completeness"] == 1.0
        assert report["ate_m"] < 0.0075
    assert first["calibration_off_px"] > 3.0
    assert again["calibration_off_px"] < 2.0


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
    report = run(folder, tmp_path / "out")
    print(f"ATE {report['ate_m']:.4f} m, {report['calibration']}")
    assert report["completeness"] == 1.0
    assert report["ate_m"] < 0.006
    for name in ("stretch_u", "stretch_v"):  # 1 - 585 / 517 in the middle; less outside, where colour's lens bends
        assert -0.14 < report["calibration"][name][1] < -0.06
