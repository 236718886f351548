"""How sure the chain is over many links, against truth, and how sure it would be if links were independent: a table.

`python -m pytest -m slow -n 0 -s tests/backend/test_chained_covariance.py`
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

from odom import Odometry, read_recording
from odom.backend.chain.chain import Chain
from odom.backend.map.pose_covariance import calibration_covariance
from odom.evaluation.metrics import nees, tangent_errors
from odom.evaluation.trajectory import Trajectory
from odom.evaluation.truth_noise import truth_noise
from odom.geometry import se3
from odom.wire import Topics, truth_body
from odom.wire.assembler import FrameAssembler
from odom.wire.codec import decode_pose
from sensors.catalogue import open_source
from sensors.source import SourceOptions

WINDOWS = (1, 5, 10, 30, 60)
BEGINS = 25
"""Frames in which the sensor's noise is not known yet."""


@dataclass(frozen=True, eq=False)
class Link:
    """A link between middle rows with its covariance, what it shares with the one before, and the stamps' part."""

    stamps: tuple[int, int]
    T: np.ndarray
    covariance: np.ndarray
    shared: np.ndarray
    T_middle_stamp: tuple[np.ndarray, np.ndarray]
    of_stamps: tuple[np.ndarray, np.ndarray]
    calibration_error: float


def links_of(camera, frames, monkeypatch):
    """The links that the odometry makes of frames."""
    links, append = [], Chain._append

    def keeping(self, end, frame, found, shared, sensor):
        links.append(
            Link(
                (end.view.stamp, frame.view.stamp),
                found.T_previous_current,
                sensor.noise.covariance_scale * found.covariance,
                shared,
                (end.published.T_middle_stamp, frame.published.T_middle_stamp),
                (end.stamp_covariance(sensor), frame.stamp_covariance(sensor)),
                sensor.noise.calibration_error,
            )
        )
        return append(self, end, frame, found, shared, sensor)

    with monkeypatch.context() as patch:
        patch.setattr(Chain, "_append", keeping)
        odometry = Odometry(camera)
        for frame in frames:
            odometry.process(frame)
    return links[BEGINS:]


def motion(links, is_joint):
    """The chained motion between the stamps of the first and of the last frame, and its covariance."""
    T, covariance = np.eye(4), np.zeros((6, 6))
    for k, link in enumerate(links):
        covariance = se3.compose_covariance(covariance, link.T, link.covariance)
        if k and is_joint:
            shared = se3.adjoint(se3.inverse(link.T)) @ link.shared
            covariance = covariance + shared + shared.T
        T = T @ link.T
    first, last = links[0], links[-1]
    T = se3.inverse(first.T_middle_stamp[0]) @ T @ last.T_middle_stamp[1]
    ends = last.of_stamps[1] + calibration_covariance(T, last.calibration_error)
    covariance = se3.compose_covariance(covariance, last.T_middle_stamp[1], ends)
    return T, se3.compose_covariance(first.of_stamps[0], T, covariance)


def sureness(links, truth, window, is_joint):
    """Mean NEES of motions over so many links, and the root mean square of what they claim (m)."""
    noise = truth_noise(truth)
    errors, covariances = [], []
    for begin in range(0, len(links) - window, max(1, window // 3)):
        part = links[begin : begin + window]
        stamps = np.array([part[0].stamps[0], part[-1].stamps[1]])
        poses, valid = truth.at(stamps, 0.1)
        if valid.all() and all(a.stamps[1] == b.stamps[0] for a, b in pairwise(part)):
            T, covariance = motion(part, is_joint)
            errors.append(tangent_errors(T[None], (se3.inverse(poses[0]) @ poses[1])[None])[0])
            covariances.append(covariance + (0.0 if noise is None else 2.0 * noise.interpolated_covariance))
    claim = np.sqrt(np.mean([np.trace(covariance[:3, :3]) for covariance in covariances]))
    return nees(np.array(errors), np.array(covariances)).mean, claim


def arena(seed, seconds):
    """Camera, frames and the exact truth of the older Kinect in the arena."""
    extra = (("exact_truth", "true"), ("seconds", str(seconds)))
    source = open_source("arena", SourceOptions(sensor="kinect1", seed=seed, extra=extra))
    assembler, frames, truth = FrameAssembler(Topics()), [], {}
    for message in source.messages():
        if truth_body(message.topic) == "exact_camera":
            pose = decode_pose(message)
            truth[pose.stamp] = pose.T_parent_child
        frames += assembler.feed(message)
    frames += assembler.finish()
    source.close()
    stamps = sorted(truth)
    return assembler.camera, frames, Trajectory(np.array(stamps), np.array([truth[stamp] for stamp in stamps]))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tum_fr1_xyz", "tum_fr1_rpy_part", "arena"])
def test_the_chain_is_nearer_to_honest_over_many_links_than_links_added_up(name, shared_data, monkeypatch):
    if name == "arena":
        camera, frames, truth = arena(seed=1, seconds=10)
    else:
        recording = read_recording(shared_data / name)
        camera, frames, truth = recording.camera, list(recording)[:240], recording.truth()["camera"]
    links = links_of(camera, frames, monkeypatch)
    print(f"\n| {name} | links | NEES, joint | as if independent | claim, joint, mm | as if independent |")
    for window in WINDOWS:
        (joint, claim), (independent, wider) = (sureness(links, truth, window, is_joint) for is_joint in (True, False))
        print(f"| | {window} | {joint:.1f} | {independent:.1f} | {1e3 * claim:.1f} | {1e3 * wider:.1f} |")
        assert joint < 9.0
        assert joint > independent or window == 1
