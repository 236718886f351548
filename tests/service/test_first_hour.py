"""A new user's way: whoever follows only what the messages say has a good result after two corrected commands."""

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import cv2
import pytest

Start = Callable[..., "subprocess.Popen[str]"]
FROM, TO = 30, 75


@pytest.fixture
def desk(shared_data: Path, tmp_path: Path) -> Path:
    """A second and a half of a real Kinect as another program exports them: depth in millimetres, no calibration."""
    source, folder = shared_data / "tum_fr1_xyz", tmp_path / "desk"
    for name in ("rgb", "depth"):
        (folder / name).mkdir(parents=True)
        lines = [line for line in (source / f"{name}.txt").read_text().splitlines() if not line.startswith("#")]
        (folder / f"{name}.txt").write_text("\n".join(lines[FROM:TO]) + "\n")
        for file in (line.split()[1] for line in lines[FROM:TO]):
            if name == "rgb":
                (folder / file).symlink_to((source / file).resolve())
            else:
                image = cv2.imread(str(source / file), cv2.IMREAD_UNCHANGED)
                cv2.imwrite(str(folder / file), image // 5)
    shutil.copy(source / "groundtruth.txt", folder)
    return folder


def test_a_typing_error_no_calibration_and_a_wrong_depth_unit_cost_two_corrected_commands(
    odom: Start, desk: Path, tmp_path: Path
) -> None:
    def run(source: str, out: str) -> tuple[int, str]:
        process = odom("run", source, "--headless", "--out", out)
        words, _ = process.communicate(timeout=120)
        assert "Traceback" not in words
        return process.returncode, words

    status, words = run("dsk", "first")
    assert status == 2
    (meant,) = re.findall(r"did you mean (\S+)\?", words)
    assert len(words.splitlines()) == 1

    status, words = run(meant, "second")
    assert status == 0
    assert words.count("has no calibration: an average Kinect's is taken") == 1
    (doubt,) = [line for line in words.splitlines() if "do not trust this result" in line]
    assert "depth is in another unit: mend depth_scale in camera.yaml" in doubt
    (line,) = re.findall(r"for depth in millimetres alone, the line (depth_scale: \d+) is enough", words)
    (tmp_path / meant / "camera.yaml").write_text(line + "\n")

    status, words = run(meant, "third")
    assert status == 0
    assert "do not trust" not in words
    report = json.loads((tmp_path / "third" / "report.json").read_text())
    assert report["completeness"] == 1.0
    assert report["ate_m"] < 0.01
    assert json.loads((tmp_path / "second" / "report.json").read_text())["ate_m"] > 0.02


def test_a_folder_as_downloaded_is_a_good_run_at_once(odom: Start, shared_data: Path, tmp_path: Path) -> None:
    folder = tmp_path / "rgbd_dataset_freiburg1_xyz"
    folder.mkdir()
    for name in ("rgb", "depth", "rgb.txt", "depth.txt", "groundtruth.txt"):
        (folder / name).symlink_to((shared_data / "tum_fr1_xyz" / name).resolve())
    process = odom("run", folder, "--headless", "--end", "2", "--out", "out")
    words, _ = process.communicate(timeout=120)
    assert process.returncode == 0, words
    assert "WARNING" not in words
    assert json.loads((tmp_path / "out" / "report.json").read_text())["ate_m"] < 0.01
