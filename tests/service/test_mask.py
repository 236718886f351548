"""A robot's deck before the camera: found by a command, and left out of the odometry by the mask that this writes."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from carrier import carried, carrier_mask
from painted_room import SMALL, PaintedRoom, stroll

from odom.errors import ConfigError
from odom.service.failed_tracking import why_poor
from odom.service.mask_file import masked_by, read_mask, write_mask
from odom.wire import Topics, codec
from odom.wire.recording import RecordingWriter
from sensors.catalogue import open_source
from sensors.source import Source, SourceOptions

FRAMES = 90


def command(*arguments: object) -> "subprocess.CompletedProcess[str]":
    line = [sys.executable, "-m", "odom", *map(str, arguments)]
    return subprocess.run(line, capture_output=True, text=True, timeout=200, check=False)


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of a walk with a deck of 40 % of the view before the camera."""
    path, topics, room = tmp_path_factory.mktemp("walk") / "walk.mcap", Topics(), PaintedRoom(seed=4)
    with RecordingWriter(path) as writer:
        for number in range(FRAMES):
            frame = carried(room.frame(SMALL, number, stroll(number / 15)), 0.4)
            if not number:
                writer.write(codec.encode_camera_info(topics.camera_info, frame.stamp, SMALL))
            rgb = np.repeat(frame.color[..., None], 3, axis=2)
            writer.write(codec.encode_color(topics.color, frame.stamp, rgb))
            writer.write(codec.encode_depth(topics.depth, frame.depth_stamp, frame.depth_mm))
    return path


def test_a_run_with_the_mask_that_the_command_found_is_in_doubt_nowhere(walk: Path, tmp_path: Path) -> None:
    mask = tmp_path / "deck.png"
    made = command("mask", walk, "--out", mask)
    assert made.returncode == 0, made.stderr
    marked = cv2.imread(str(mask), cv2.IMREAD_GRAYSCALE) > 0
    true = carrier_mask(PaintedRoom().frame(SMALL, 0, np.eye(4)), 0.4)
    assert not (true & ~marked).any()
    assert (marked & ~true).mean() < 0.08
    assert command("mask", walk, "--out", mask).returncode == 2  # it is there already
    done = command("run", walk, "--mask", mask, "--headless", "--out", tmp_path / "run")
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "run" / "report.json").read_text())
    assert report["states"]["TRACKING"] == FRAMES


def test_the_doctor_names_a_deck_until_it_is_masked(walk: Path, tmp_path: Path) -> None:
    plain, masked, mask = tmp_path / "plain.json", tmp_path / "masked.json", tmp_path / "deck.png"
    write_mask(mask, carrier_mask(PaintedRoom().frame(SMALL, 0, np.eye(4)), 0.42))
    command("doctor", walk, "--json", plain)
    command("doctor", walk, "--mask", mask, "--json", masked)
    before, after = ({one["check"]: one for one in json.loads(path.read_text())} for path in (plain, masked))
    assert before["own parts"]["verdict"] == "BAD"
    assert after["own parts"]["verdict"] == "good"
    assert after["tracking"]["verdict"] == "good"


def test_a_mask_comes_back_as_it_was_written_and_fits_images_of_the_same_form(tmp_path: Path) -> None:
    mask = np.zeros((480, 640), dtype=np.bool_)
    mask[300:] = True
    write_mask(tmp_path / "mask.png", mask)
    np.testing.assert_array_equal(read_mask(tmp_path / "mask.png"), mask)
    segmenter = masked_by(tmp_path / "mask.png", SMALL)
    assert segmenter is not None
    np.testing.assert_array_equal(segmenter(PaintedRoom().frame(SMALL, 0, np.eye(4))), mask[::2, ::2])
    assert masked_by(None, SMALL) is None


def test_what_cannot_be_a_mask_is_refused_with_its_reason(tmp_path: Path) -> None:
    for name, mask, words in (
        ("black", np.zeros((480, 640), bool), "is all black"),
        ("white", np.ones((480, 640), bool), "is all white"),
        ("wide", np.arange(640) < 9 + np.zeros((360, 640), int), "is 640 x 360, the camera's images are 320 x 240"),
    ):
        write_mask(tmp_path / f"{name}.png", mask)
        with pytest.raises(ConfigError, match=words):
            masked_by(tmp_path / f"{name}.png", SMALL)
    (tmp_path / "words.png").write_text("no image")
    for name in ("words.png", "nowhere.png"):
        with pytest.raises(ConfigError, match="no image that can be read"):
            masked_by(tmp_path / name, SMALL)
    with pytest.raises(ConfigError, match=r"give the name of a \.png file"):
        write_mask(tmp_path / "mask.what", np.eye(3) > 0)


def test_a_run_with_a_mask_that_is_none_touches_nothing(walk: Path, tmp_path: Path) -> None:
    done = command("run", walk, "--mask", tmp_path / "nowhere.png", "--headless", "--out", tmp_path / "run")
    assert done.returncode == 2
    assert "no image that can be read" in done.stderr
    assert not (tmp_path / "run").exists()


def test_a_poor_run_names_the_deck_and_with_its_mask_does_not(walk: Path, tmp_path: Path) -> None:
    def opened() -> Source:
        return open_source(str(walk), SourceOptions())

    mask, poor = tmp_path / "deck.png", {"completeness": 0.1, "tracked": 9, "frames": FRAMES}
    write_mask(mask, carrier_mask(PaintedRoom().frame(SMALL, 0, np.eye(4)), 0.42))
    assert "own parts" in (why_poor(poor, tmp_path, opened) or "")
    assert "own parts" not in (why_poor(poor, tmp_path, opened, mask) or "")
