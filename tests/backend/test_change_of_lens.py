"""A better camera found on the way: the map moves, what is published goes on from where it was, and is better."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from running import run

from odom.backend import Odometry, State
from odom.backend.odometry import recalibration
from odom.evaluation.report import evaluate
from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera
from odom.geometry import se3

EARLY = replace(recalibration.TUNING, calibrate_least=8)


class Told:
    """A calibrator that knows the camera."""

    again = 2.0

    def __init__(self, camera: Camera) -> None:
        self._camera, self.looks = camera, 0

    def looked_at(self, odometry: Odometry) -> Callable[[], Camera | None]:
        self.looks += 1
        return lambda: self._camera


def poor(camera: Camera) -> Camera:
    """A camera that is off as an average one's calibration is: 3 % long, its centre 12 px aside."""
    return replace(camera, fx=1.03 * camera.fx, fy=1.03 * camera.fy, cx=camera.cx + 8.0, cy=camera.cy - 12.0)


@pytest.fixture(scope="module")
def changed(arena):
    """An odometry that was told the true camera on the way, its estimates, and when it went on with that."""
    camera, frames = arena
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recalibration, "TUNING", EARLY)
        odometry = Odometry(poor(camera), calibrator=Told(camera))
        estimates, at = [], None
        for number, drawn in enumerate(frames):
            estimates.append(odometry.process(drawn.rgbd()))
            if at is None and odometry.camera_in_use is not odometry.camera:
                at = number
    return odometry, estimates, at


def test_nothing_is_lost_and_nothing_jumps(changed):
    _, estimates, at = changed
    assert at is not None
    assert at < 80
    assert all(estimate.state is State.TRACKING for estimate in estimates[1:])
    assert all(not estimate.chain.hole for estimate in estimates)
    where = np.array([estimate.T_odom_camera[:3, 3] for estimate in estimates])
    jerk = np.linalg.norm(np.diff(where, n=2, axis=0), axis=1)
    assert jerk[at - 3 : at + 3].max() < 1.5 * np.delete(jerk, np.arange(at - 3, at + 3)).max()
    turns = [np.trace(a.T_odom_camera[:3, :3].T @ b.T_odom_camera[:3, :3]) for a, b in pairwise(estimates)]
    angle = np.degrees(np.arccos(np.clip((np.array(turns) - 1.0) / 2.0, -1.0, 1.0)))
    assert angle[at - 2 : at + 2].max() < 1.2 * angle.max() < 5.0


def test_from_then_on_it_is_tracked_as_by_the_better_camera(changed, arena, arena_truth):
    _, estimates, at = changed
    kept = run(poor(arena[0]), [drawn.rgbd() for drawn in arena[1]]).estimates

    def error(ran):
        rest = ran[at + 1 :]
        poses = Trajectory(np.array([e.stamp for e in rest]), np.array([e.T_odom_camera for e in rest]))
        return evaluate(poses, arena_truth).ate_m

    assert error(estimates) < 0.7 * error(kept)


def test_the_final_trajectory_is_that_of_the_better_camera(changed, arena_truth, arena_ran):
    odometry, _, _ = changed
    final = Trajectory.of(odometry.finish())
    assert evaluate(final, arena_truth).ate_m < 1.5 * arena_ran.judged(arena_truth).ate_m + 5e-4


def test_a_calibrator_that_finds_nothing_changes_nothing(arena, arena_ran, monkeypatch):
    monkeypatch.setattr(recalibration, "TUNING", EARLY)
    camera, frames = arena
    nobody = Told(None)
    odometry = Odometry(camera, calibrator=nobody)
    for drawn, plain in zip(frames[:90], arena_ran.estimates, strict=False):
        np.testing.assert_array_equal(odometry.process(drawn.rgbd()).T_odom_camera, plain.T_odom_camera)
    assert nobody.looks >= 1


def test_what_the_poor_lens_displaced_is_taken_back_as_the_camera_moves(changed):
    _, estimates, at = changed
    left = [np.linalg.norm(se3.log(estimate.T_map_odom)) for estimate in estimates[at:]]
    assert max(left) > 1e-4
    assert left[-1] < 0.7 * max(left)
