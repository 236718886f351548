"""Parts of a trajectory that were never joined are never passed off as one."""

import json
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from odom.evaluation.files import read_run, read_tum, write_tum
from odom.evaluation.trajectory import Trajectory

FIRST, SECOND = slice(0, 60), slice(150, 210)
WITHIN_DEG, BETWEEN_DEG = 5.0, 20.0
"""Truth shakes by a degree or two in this fast rotation; poses of two places glued together are off by thirty."""


MIRROR = np.diag([-1.0, 1.0, 1.0, 1.0])


@pytest.fixture
def two_places(shared_data: Path, tmp_path: Path) -> Path:
    """Two seconds of a camera that is turned fast, and two in the mirrored room, where nothing is the same."""
    whole, cut = shared_data / "tum_fr1_rpy_part", tmp_path / "two-places"
    cut.mkdir()
    (cut / "camera.yaml").symlink_to(whole / "camera.yaml")
    turn: float = stamp_of(rows_of(whole / "rgb.txt")[SECOND.start])
    for stream in ("rgb", "depth"):
        (cut / stream).mkdir()
        rows = rows_of(whole / f"{stream}.txt")
        if stream == "rgb":
            rows = rows[FIRST] + rows[SECOND]
        for row in rows:
            name = row.split()[1]
            if stamp_of(row) < turn:
                (cut / name).symlink_to(whole / name)
            else:
                cv2.imwrite(str(cut / name), cv2.flip(cv2.imread(str(whole / name), cv2.IMREAD_UNCHANGED), 1))
        (cut / f"{stream}.txt").write_text("\n".join(rows) + "\n")
    truth = read_tum(whole / "groundtruth.txt")
    mirrored = np.where(
        truth.stamps[:, None, None] < turn * 1e9, truth.T_world_body, MIRROR @ truth.T_world_body @ MIRROR
    )
    write_tum(cut / "groundtruth.txt", replace(truth, T_world_body=mirrored))
    return cut


def rows_of(path: Path) -> list[str]:
    return [line for line in path.read_text().splitlines() if not line.startswith("#")]


def stamp_of(row: str) -> float:
    return float(row.split()[0])


def turned_wrongly_deg(part: Trajectory, truth: Trajectory) -> float:
    """Degrees by which a part's rotations are off truth's at the most, both since the part's first pose."""
    true, valid = truth.at(part.stamps, 0.1)
    R, R_true = Rotation.from_matrix(part.T_world_body[valid, :3, :3]), Rotation.from_matrix(true[valid, :3, :3])
    errors = (R_true[0].inv() * R_true).inv() * (R[0].inv() * R)
    return float(np.degrees(errors.magnitude()).max())


def test_each_file_holds_one_joined_part(
    odom: Callable[..., "subprocess.Popen[str]"], two_places: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    run = odom("run", two_places, "--headless", "--out", out)
    said, _ = run.communicate(timeout=120)
    assert run.returncode == 0, said
    report = json.loads((out / "report.json").read_text())
    truth = read_tum(out / "truth.txt")
    assert [part["file"] for part in report["segments"]] == ["trajectory.txt", "trajectory-segment-1.txt"]
    parts = [read_tum(out / part["file"]) for part in report["segments"]]
    assert [len(part) for part in parts] == [part["frames"] for part in report["segments"]]
    assert len(parts[0]) > len(parts[1])
    assert all(turned_wrongly_deg(part, truth) < WITHIN_DEG for part in parts)
    glued = read_run(out)
    assert turned_wrongly_deg(glued, truth) > BETWEEN_DEG
    remark = f"# the largest of 2 parts that were never joined, {len(parts[0])} of {len(glued)} poses"
    assert remark in (out / "trajectory.txt").read_text()
    assert report["matched"] <= len(parts[0])
    assert report["total"] == 120
    assert "largest of 2 parts" in said

    causal = read_tum(out / "odometry.txt")
    assert causal.segment is not None
    pieces = [causal.take(causal.segment == number) for number in (0, 1)]
    assert sum(map(len, pieces)) == len(causal)
    assert all(turned_wrongly_deg(piece, truth) < WITHIN_DEG for piece in pieces)
    assert (out / "odometry.txt").read_text().count("# continuity ends") == 1
