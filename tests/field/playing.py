"""A virtual Kinect that plays the committed recording, for tests of the whole pipeline."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from rig import Process
from virtual_kinect.device import VirtualKinect, write_sequence

from odom.wire import Topics
from odom.wire.codec import decode_color, decode_depth
from sensors.replay import open_recording
from sensors.source import SourceOptions

TOPICS = Topics("cam0")
RECORDING = Path(__file__).parents[2] / "recordings" / "arena.mcap"


@pytest.fixture(scope="session")
def rendered() -> tuple[np.ndarray, np.ndarray]:
    """Colour and depth of the committed recording."""
    source = open_recording(RECORDING, SourceOptions(topics=TOPICS))
    color, depth = [], []
    for message in source.messages():
        if "/color/image" in message.topic:
            color.append(decode_color(message))
        elif "/depth/" in message.topic:
            depth.append(decode_depth(message))
    source.close()
    count = min(len(color), len(depth))
    return np.stack(color[:count]), np.stack(depth[:count])


class PlayingKinect:
    """A virtual Kinect that plays some frames, and `odom run` on it."""

    def __init__(self, folder: Path, color: np.ndarray, depth: np.ndarray) -> None:
        self.color, self.depth, self.folder = color, depth, folder
        self.size = f"{color.shape[2]}x{color.shape[1]}"
        self.kinect = VirtualKinect(folder / "kinects" / "a", uri="virtual://a", serial="VK42", loop=1)
        # 525 px of focal length at 640 x 480.
        self.kinect.configure(horizontal_fov=2 * np.arctan(320 / 525), vertical_fov=2 * np.arctan(240 / 525))
        write_sequence(self.kinect, color, depth)
        self.kinect.plug()
        self.out, self.recording = folder / "live", folder / "live.mcap"

    def live(self, seconds: float, *more: str) -> Process:
        arguments = ["run", "kinect", "--headless", "--out", self.out, "--record", self.recording, "--seconds", seconds]
        options = ["--sensor-option=--color=raw", f"--sensor-option=--option=size={self.size}"]
        return Process("run", self.folder / "run.log", [*arguments, *options, *more])


@pytest.fixture
def kinect_driver(openni2_redist: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("OPENNI2_REDIST64", str(openni2_redist))
    monkeypatch.setenv("VIRTUAL_KINECT", str(tmp_path / "kinects"))
    return tmp_path


@pytest.fixture
def rig(kinect_driver: Path, rendered: tuple[np.ndarray, np.ndarray]) -> PlayingKinect:
    return PlayingKinect(kinect_driver, *rendered)


@pytest.fixture
def vga_rig(kinect_driver: Path, rendered: tuple[np.ndarray, np.ndarray]) -> PlayingKinect:
    color = np.stack([cv2.resize(image, (640, 480), interpolation=cv2.INTER_CUBIC) for image in rendered[0]])
    depth = np.stack([cv2.resize(image, (640, 480), interpolation=cv2.INTER_NEAREST) for image in rendered[1]])
    return PlayingKinect(kinect_driver, color, depth)
