"""A run of a recording in this process: what `odom run` does in several, without their start-up and the wire."""

from dataclasses import dataclass

import cv2
import numpy as np

from odom import Odometry, RgbdRecording, Trajectory
from odom.backend import State
from odom.calibration.mid_run import MidRunCalibrator
from odom.calibration.self_calibration import SelfCalibration, self_calibrated
from odom.evaluation.report import evaluate
from odom.frame import Camera
from odom.service.replayed import frames_of
from odom.service.run_calibration import latest_calibration
from sensors.catalogue import open_source


@dataclass(frozen=True, eq=False)
class RanHere:
    """The odometry of a run that has ended, and what the run left.

    `final` is the trajectory as in `trajectory.txt`, `online` the poses as published, `own` what the run says of its
    calibration; `completeness` is the share of frames with a pose.
    """

    odometry: Odometry
    final: Trajectory
    online: Trajectory
    own: SelfCalibration
    completeness: float


def run_here(recording: RgbdRecording, camera: Camera | None = None, calibrates: bool = True) -> RanHere:
    """Run the odometry over a recording by its camera or another one, with self-calibration unless told otherwise."""
    cv2.setNumThreads(1)
    odometry = Odometry(camera or recording.camera, calibrator=MidRunCalibrator() if calibrates else None)
    source = open_source(str(recording.path), recording.options)
    try:
        frames = frames_of(source.messages(), recording.options.topics)
        estimates = [odometry.process(frame) for _, frame in frames]
    finally:
        source.close()
    kept = odometry.finish()
    posed = [(e.stamp, e.T_odom_camera) for e in estimates if e.T_odom_camera is not None]
    online = Trajectory(np.array([stamp for stamp, _ in posed]), np.array([T for _, T in posed]))
    own = self_calibrated(odometry, latest_calibration(odometry)) if calibrates else SelfCalibration(reason="off")
    completeness = float(np.mean([e.state is not State.LOST for e in estimates]))
    return RanHere(odometry, Trajectory.of(own.trajectory or kept), online, own, completeness)


def ate_m(trajectory: Trajectory, recording: RgbdRecording) -> float:
    """Error of a trajectory (root mean square, m) against the recording's truth of its camera."""
    found = evaluate(trajectory, recording.truth()["camera"]).ate_m
    assert found is not None
    return found
