"""Running the odometry over frames, and judging it."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from odom.backend import Estimate, Odometry, OdometrySettings, State, TrajectoryPose
from odom.evaluation.files import read_tum
from odom.evaluation.report import Report, evaluate
from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera, RgbdFrame
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.wire import Topics
from odom.wire.assembler import FrameAssembler
from sensors.catalogue import open_source
from sensors.source import SourceOptions


@dataclass(frozen=True, eq=False)
class Ran:
    """What came out of a run."""

    estimates: tuple[Estimate, ...]
    final: tuple[TrajectoryPose, ...]
    timing: ShutterTiming

    @property
    def states(self) -> list[State]:
        return [e.state for e in self.estimates]

    @property
    def corrected(self) -> Trajectory:
        """The final trajectory."""
        posed = [p for p in self.final if p.T_map_camera is not None]
        stamps = np.array([p.stamp for p in posed], dtype=np.int64)
        return Trajectory(stamps, np.array([p.T_map_camera for p in posed]), np.array([p.segment for p in posed]))

    @property
    def online(self) -> Trajectory:
        """The poses as published, in `odom`."""
        posed = [e for e in self.estimates if e.T_odom_camera is not None]
        stamps = np.array([e.stamp for e in posed], dtype=np.int64)
        return Trajectory(stamps, np.array([e.T_odom_camera for e in posed]))

    def judged(self, truth: Trajectory) -> Report:
        """The final trajectory against truth."""
        return evaluate(self.corrected, truth)

    def first(self, state: State, after: int) -> Estimate:
        """The first estimate of this state whose stamp is not before `after`."""
        return next(e for e in self.estimates if e.state is state and e.stamp >= after)


def read_tum_frames(folder: Path, most: int | None) -> tuple[Camera, list[RgbdFrame], Trajectory]:
    """A recording's camera, its first frames and the truth."""
    assembler = FrameAssembler(Topics(), grey=True)
    source = open_source(str(folder), SourceOptions())
    frames: list[RgbdFrame] = []
    for message in source.messages():
        frames += assembler.feed(message)
        if most is not None and len(frames) >= most:
            break
    else:
        frames += assembler.finish()
    assert assembler.camera is not None
    return assembler.camera, frames, read_tum(folder / "groundtruth.txt")


def run(camera: Camera, frames: Iterable[RgbdFrame], settings: OdometrySettings | None = None) -> Ran:
    """Run the odometry over all frames."""
    odometry = Odometry(camera, settings)
    estimates = tuple(odometry.process(frame) for frame in frames)
    return Ran(estimates, odometry.finish(), odometry.timing)


def numbers(ran: Ran) -> bytes:
    """Every number that was published, as bytes; times taken are not among them."""
    parts = []
    for e in ran.estimates:
        parts += [e.sequence, e.stamp, e.segment, e.inliers, e.matches, e.is_keyframe, e.T_odom_camera, e.covariance]
        parts += [e.T_map_odom, e.landmarks_map, *([] if e.features is None else [e.features.uv])]
        parts += [] if e.features is None else [e.features.residual_sigma]
        for relative in (e.step, e.second, e.pairwise):
            if relative is not None:
                parts += [relative.stamp_earlier, relative.T_earlier_current, relative.covariance, relative.inliers]
        for pose in e.path or ():
            parts += [pose.stamp, pose.T_map_camera]
        for loop in e.loops:
            parts += [loop.stamp, loop.candidate_stamp, loop.inliers, loop.accepted, loop.T_candidate_current]
    for pose in ran.final:
        parts += [pose.stamp, pose.T_map_camera]
    texts = "".join(f"{e.state} {e.reason} {[x.reason for x in e.loops]}" for e in ran.estimates)
    arrays = b"".join(b"-" if part is None else np.asarray(part, dtype=np.float64).tobytes() for part in parts)
    return arrays + texts.encode()


def check_sanity(ran: Ran) -> None:
    """No pose is NaN or no motion, covariances are positive, LOST has no pose and nothing else lacks one."""
    for e in ran.estimates:
        assert (e.T_odom_camera is None) == (e.state is State.LOST)
        assert (e.covariance is None) == (e.T_odom_camera is None)
        for relative in (e.step, e.second, e.pairwise):
            if relative is not None:
                assert relative.stamp_earlier < e.stamp
                assert np.linalg.eigvalsh(relative.covariance)[0] > 0
        covariances = [e.covariance, *(r.covariance for r in (e.step, e.second, e.pairwise) if r is not None)]
        for covariance in covariances:
            if covariance is not None:
                assert np.isfinite(covariance).all()
                assert np.linalg.eigvalsh(covariance)[0] >= -1e-15
    poses = [e.T_odom_camera for e in ran.estimates] + [p.T_map_camera for p in ran.final]
    poses += [e.T_map_odom for e in ran.estimates]
    T = np.array([p for p in poses if p is not None])
    assert np.isfinite(T).all()
    R = T[:, :3, :3]
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.broadcast_to(np.eye(3), R.shape), atol=1e-6)
    assert [p.stamp for p in ran.final] == [e.stamp for e in ran.estimates]
