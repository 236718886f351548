"""Bodies that walk through the view: the camera is followed, not them, and what they wear is not in the map."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from odom import Odometry, RgbdFrame, Trajectory, read_recording
from odom.evaluation.painter import Painter, anchor_in_world
from odom.evaluation.passers_by import nearer_than, passers_by
from odom.evaluation.robustness.verdict import Verdict, verdict
from odom.frontend.camera.lens import Lens
from sensors.arena import ArenaOptions, render_walk


def painted(
    shared_data, name: str, seed: int, end: float | None = None, count: int = 1, share: float = 0.33
) -> tuple[Painter, Iterable[RgbdFrame], Trajectory]:
    recording = read_recording(shared_data / name, end=end)
    frames, truth = list(recording), recording.truth()["camera"]
    bodies = passers_by(recording.camera, nearer_than(frames[:40:10]), count=count, share=share, seed=seed)
    painter = Painter(
        recording.camera, bodies, frames[0].stamp, anchor_in_world(truth), Lens.of(recording.camera), seed
    )
    return painter, frames, truth


def run(painter: Painter, frames: Iterable[RgbdFrame], truth: Trajectory) -> tuple[Verdict, float]:
    """The verdict, and which share of the landmarks that the frames were tracked by lies on a body."""
    odometry = Odometry(painter.camera)
    estimates, on_body, inliers = [], 0, 0
    for frame in frames:
        seen, mask = painter.paint(frame)
        estimates.append(odometry.process(seen))
        features = estimates[-1].features
        if features is not None:
            u, v = features.uv[np.isfinite(features.residual_sigma)].astype(int).T
            on_body, inliers = on_body + np.count_nonzero(mask[v, u]), inliers + len(u)
    return verdict(estimates, Trajectory.of(odometry.finish()), truth), on_body / inliers


AS_IT_IS_M = {"tum_fr1_xyz": 0.0032, "tum_fr1_rpy_part": 0.0060}
"""ATE of the recordings without a passer-by."""


@pytest.mark.parametrize("name", AS_IT_IS_M)
def test_a_passer_by_from_the_first_frame_on_is_not_followed(shared_data: Path, name: str) -> None:
    found, share_on_body = run(*painted(shared_data, name, 1, end=3.0))
    assert found.wrong == 0
    assert found.lost == 0
    assert found.ate_m is not None
    assert found.ate_m < 1.5 * AS_IT_IS_M[name]
    assert share_on_body < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
@pytest.mark.parametrize("name", AS_IT_IS_M)
def test_a_passer_by_a_third_of_the_view_wide_costs_little(shared_data: Path, name: str, seed: int) -> None:
    found, share_on_body = run(*painted(shared_data, name, seed))
    print(f"{name} seed {seed}: ATE {found.ate_m}, NEES {found.nees}, wrong {found.wrong}, on body {share_on_body:.3f}")
    assert found.ate_m is not None
    assert found.nees is not None
    assert found.ate_m <= 1.5 * AS_IT_IS_M[name]
    assert found.wrong <= 0.005
    assert found.nees <= 9.0


@pytest.mark.slow
@pytest.mark.parametrize("name", AS_IT_IS_M)
def test_three_of_them_leave_gaps_and_doubt_but_hardly_a_wrong_pose(shared_data: Path, name: str) -> None:
    found, share_on_body = run(*painted(shared_data, name, 1, count=3))
    print(f"{name}: {found}, on body {share_on_body:.3f}")
    assert found.ate_m is not None
    assert found.ate_m <= 0.025
    assert found.ate_share >= 0.85
    assert found.wrong <= 0.01


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed"), [("tum_fr1_xyz", 8), ("tum_fr1_rpy_part", 5)])
def test_a_camera_before_a_body_that_fills_most_of_the_view_from_the_start_is_nowhere_sure_and_wrong(
    shared_data: Path, name: str, seed: int
) -> None:
    found, share_on_body = run(*painted(shared_data, name, seed, end=5.5, share=0.6))
    print(f"{name}: {found}, on body {share_on_body:.3f}")
    assert 0.0 < share_on_body < 0.5  # it is before the camera, and not what is followed for most of the walk
    assert found.wrong == 0.0


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "seed", "count", "share"), [("tum_fr1_rpy_part", 1, 2, 0.4), ("tum_fr1_xyz", 3, 2, 0.4)]
)
def test_among_bodies_that_fill_much_of_the_view_none_is_followed_and_the_covariance_is_honest(
    shared_data: Path, name: str, seed: int, count: int, share: float
) -> None:
    found, share_on_body = run(*painted(shared_data, name, seed, end=2.5, count=count, share=share))
    assert share_on_body < 0.05
    assert found.wrong == 0.0
    assert found.nees is not None
    assert found.nees <= 9.0


@pytest.mark.slow
@pytest.mark.parametrize(("people", "ate_m"), [(1, 0.004), (2, 0.006), (4, 0.010)])
def test_people_in_the_arena_cost_little(people: int, ate_m: float) -> None:
    options = ArenaOptions(people=people)
    odometry = Odometry(options.camera)
    frames = list(render_walk(options))
    estimates = [odometry.process(frame.rgbd()) for frame in frames]
    truth = Trajectory(np.array([f.stamp for f in frames]), np.array([f.T_world_camera for f in frames]))
    found = verdict(estimates, Trajectory.of(odometry.finish()), truth)
    print(f"{people} people: ATE {found.ate_m}, NEES {found.nees}, wrong {found.wrong}, lost {found.lost}")
    assert found.ate_m is not None
    assert found.nees is not None
    assert found.ate_m <= ate_m
    assert found.wrong <= 0.005
    assert found.nees <= 9.0
