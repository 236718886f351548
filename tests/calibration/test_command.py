"""`odom calibrate` as a user calls it: files that `--camera` takes, and what it refuses and why."""

import os
import shlex
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from odom.errors import ConfigError
from odom.service.calibration_files import how_to_use
from sensors.calibration_file import Calibration, calibration_text, load_calibration
from sensors.catalogue import check_source
from sensors.default_camera import kinect_camera
from sensors.source import SourceOptions

RECORDING = Path(__file__).parents[2] / "recordings" / "arena.mcap"
COMMAND = [sys.executable, "-m", "odom", "calibrate"]


def calibrate(*arguments, timeout=580):
    done = subprocess.run(
        [*COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=timeout, env=os.environ, check=False
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.slow
def test_a_wrong_focal_length_is_mended(tmp_path):
    wrong, out = tmp_path / "wrong.yaml", tmp_path / "camera.yaml"
    wrong.write_text(calibration_text(Calibration(replace(kinect_camera(320, 240), fx=273.0, fy=273.0))))
    status, text, errors = calibrate(RECORDING, "--camera", wrong, "--out", out)
    assert status == 0, errors
    assert load_calibration(out).camera.fx == pytest.approx(262.5, abs=1.5)
    assert out.read_text().startswith("# odom calibrate")
    assert (tmp_path / "camera.txt").read_text() in text
    assert (tmp_path / "camera.png").stat().st_size > 10_000
    status, _, errors = calibrate(RECORDING, "--out", out)
    assert status == 2
    assert "--overwrite" in errors


@pytest.mark.slow
@pytest.mark.parametrize("times", [0.7, 1.6])
def test_the_calibration_of_another_camera_is_refused_with_the_reason(tmp_path, times):
    other, out, average = tmp_path / "other.yaml", tmp_path / "camera.yaml", kinect_camera(320, 240)
    camera = replace(average, fx=times * average.fx, fy=times * average.fy)
    other.write_text(calibration_text(Calibration(camera)))
    status, _, errors = calibrate(RECORDING, "--camera", other, "--out", out)
    assert status == 1
    assert "another camera" in errors
    assert not out.exists()


@pytest.mark.long
def test_a_camera_at_rest_shows_nothing_and_nothing_is_written(tmp_path):
    out = tmp_path / "camera.yaml"
    status, text, errors = calibrate("arena", "--seconds", "2", "--option", "walk=rest", "--out", out)
    assert status == 1, errors
    assert not out.exists()
    assert "not shown by this walk" in text or "walk on" in errors


def test_the_advice_can_be_pasted_where_names_have_blanks(tmp_path):
    recording, out = str(tmp_path / "a walk.mcap"), tmp_path / "my camera.yaml"
    shutil.copy(RECORDING, recording)
    advice = how_to_use(recording, out)
    assert shlex.split(advice)[2:] == ["odom", "run", recording, "--camera", str(out)]


@pytest.mark.parametrize("source", [str(RECORDING), "kinect", "arena"])
def test_the_advice_is_a_call_that_is_not_refused(tmp_path, source):
    out = tmp_path / "camera.yaml"
    out.write_text(calibration_text(Calibration(kinect_camera(320, 240))))
    advice = how_to_use(source, out)
    assert str(out) in advice
    if "odom run" in advice:
        check_source(source, SourceOptions(camera=out))
    else:
        with pytest.raises(ConfigError):
            check_source(source, SourceOptions(camera=out))


def test_another_name_than_yaml_is_refused(tmp_path):
    status, _, errors = calibrate(RECORDING, "--out", tmp_path / "camera.txt")
    assert status == 2
    assert ".yaml" in errors
