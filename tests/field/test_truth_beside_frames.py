"""OptiTrack beside a Kinect: one recording holds both, in one time."""

from pathlib import Path

import numpy as np
import pytest
from natnet_server import NatNetServer
from playing import PlayingKinect
from rig import Process, free_port, processes

from odom.wire.recording import RecordingReader


@pytest.mark.timeout(400)
def test_frames_and_truth_are_recorded_together(rig: PlayingKinect, tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    meet = ["--mode", "client", "--connect", endpoint]
    take = tmp_path / "take.mcap"
    with (
        NatNetServer({"camera rig": lambda t: ((0.1 * np.sin(t), 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))}) as mocap,
        processes() as started,
    ):

        def start(name: str, *arguments: object) -> Process:
            started.append(Process(name, tmp_path / f"{name}.log", arguments))
            return started[-1]

        start("router", "router", "--listen", endpoint).wait_for("routing at", 60)
        recorder = start("recorder", "record", take, *meet)
        options = ["--option", f"command_port={mocap.command_port}", "--seconds", "60", "--namespace", "mocap", *meet]
        truth = start("truth", "sensor", "optitrack:127.0.0.1", *options)
        truth.wait_for("Virtual Motive", 60)
        sensor = start("sensor", "sensor", "kinect", "--option", f"size={rig.size}", "--seconds", "6", *meet)
        assert sensor.popen.wait(120) == 0, sensor.said
        assert truth.end() == 0, truth.said
        assert recorder.popen.wait(60) == 0, recorder.said  # it ends with its source
    stamps: dict[str, list[int]] = {}
    for message in RecordingReader(take).messages():
        stamps.setdefault(message.topic, []).append(message.stamp)
    poses, images = np.array(stamps["truth/camera_rig/pose"]), np.array(stamps["cam0/depth/image_raw"])
    assert len(images) > 100
    assert 80 < len(poses) / ((poses[-1] - poses[0]) * 1e-9) < 130
    # Every image taken while the motion capture ran has a true pose within a few of its frames.
    within = images[(images > poses[0]) & (images < poses[-1])]
    assert len(within) > 60
    assert np.median(np.abs(within[:, None] - poses[None, :]).min(axis=1)) < 10e6
