"""What a run has learnt of a device is used in its next runs, if the user says so, and in no other device's."""

import logging
from dataclasses import replace

import pytest

from odom.errors import ConfigError
from odom.service.calibration_offer import CALIBRATION_FILE, remember_calibration
from sensors.calibration_file import Calibration, calibration_text
from sensors.default_camera import kinect_camera
from sensors.openni2.messages import DeviceEncoder
from sensors.openni2.settings import KinectSettings
from sensors.remembered import remembered_file
from sensors.source import SourceOptions

FACTORY = kinect_camera(640, 480)
LEARNT = replace(FACTORY, fx=517.3, cy=255.3, distortion=(0.2, -0.5, 0.0, 0.0, 0.1))


@pytest.fixture(autouse=True)
def _own_data_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))


def learnt_by_a_run(folder):
    (folder / CALIBRATION_FILE).write_text(calibration_text(Calibration(LEARNT), ["found by odom run"]))
    return folder


def camera_of(serial, **options):
    return DeviceEncoder(SourceOptions(**options), KinectSettings(), FACTORY, True, serial).camera


def test_what_was_learnt_of_a_device_is_used_for_it_alone(tmp_path):
    remember_calibration(learnt_by_a_run(tmp_path), "A00361A01234567A")
    assert camera_of("A00361A01234567A") == LEARNT
    assert camera_of("B70994A99999999B") == FACTORY
    assert camera_of("") == FACTORY


def test_a_calibration_that_is_given_comes_first(tmp_path):
    remember_calibration(learnt_by_a_run(tmp_path), "A1")
    own = tmp_path / "own.yaml"
    own.write_text(calibration_text(Calibration(replace(FACTORY, fx=530.0))))
    assert camera_of("A1", camera=own).fx == 530.0


def test_it_is_not_used_for_images_of_another_size(tmp_path):
    remember_calibration(learnt_by_a_run(tmp_path), "A1")
    small = kinect_camera(320, 240)
    assert DeviceEncoder(SourceOptions(), KinectSettings(size="320x240"), small, True, "A1").camera == small


def test_a_spoilt_file_is_told_and_left_out(tmp_path, caplog):
    remember_calibration(learnt_by_a_run(tmp_path), "A1")
    remembered_file("A1").write_text("image_width: [")
    assert camera_of("A1") == FACTORY
    assert "no remembered calibration" in caplog.text


def test_a_source_without_serial_number_is_told_what_to_do_instead(tmp_path, caplog):
    remember_calibration(learnt_by_a_run(tmp_path), "")
    assert "--camera" in caplog.text


def test_a_good_calibration_leaves_nothing_to_remember(tmp_path, caplog):
    caplog.set_level(logging.INFO)
    remember_calibration(tmp_path, "A1")
    assert "no calibration to remember" in caplog.text
    assert not remembered_file("A1").exists()


@pytest.mark.parametrize("serial", ["", "../other", "a/b", ".hidden", "x" * 65])
def test_a_serial_number_names_no_other_place(serial):
    with pytest.raises(ConfigError):
        remembered_file(serial)
