"""Alignment by positions and orientations: right, honest about itself, and evo's where orientations say nothing."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic import smooth, trajectory
from typer.testing import CliRunner

from odom.cli import app
from odom.errors import InputError
from odom.evaluation import align
from odom.evaluation.pose_alignment import PoseErrors, align_poses, align_poses_alike, pose_errors
from odom.frame import Stamp
from odom.geometry import se3
from odom.wire.codec import encode_odometry, encode_pose
from odom.wire.recording import RecordingWriter

SEEDS = 60
SIGMA = np.array([0.004] * 3 + [0.01] * 3)


def _poses(rng, metres=0.3, count=80):
    """Poses of a camera in its own world, and the motion from there to the truth's world."""
    pose = smooth(rng, seconds=8.0, metres=metres)
    return trajectory(pose, np.linspace(0.0, 8.0, count)).T_world_body, se3.exp(rng.normal(0, 1.0, 6))


def _spoilt(T, e):
    return np.array([pose @ se3.exp(x) for pose, x in zip(T, e, strict=True)])


def _random_covariances(rng, count):
    """Covariances of all sizes and directions: some poses are far surer than others."""
    axes = np.linalg.qr(rng.normal(0, 1, (count, 6, 6)))[0]
    scaled = (axes * rng.uniform(0.1, 4.0, (count, 1, 6))) @ axes.transpose(0, 2, 1)
    return SIGMA[:, None] * SIGMA * scaled * rng.uniform(0.2, 5.0, (count, 1, 1))


def _nees(found, T_true):
    e = se3.log(se3.inverse(found.T_truth_estimate) @ T_true)
    return e @ np.linalg.solve(found.covariance, e)


def _mean_nees(one_seed):
    return np.mean([one_seed(np.random.default_rng(seed)) for seed in range(SEEDS)])


@pytest.mark.parametrize("metres", [0.3, 0.001])
def test_the_covariance_is_honest_for_independent_errors(metres):
    """The mean of 60 NEES of six degrees of freedom is within 6 +- 1.4 in 998 of 1000 cases."""

    def one(rng):
        T, Y = _poses(rng, metres)
        S = _random_covariances(rng, len(T))
        e = (np.linalg.cholesky(S) @ rng.normal(size=(len(S), 6, 1)))[:, :, 0]
        return _nees(align_poses(T, Y @ _spoilt(T, e), PoseErrors(S)), Y)

    assert 4.6 < _mean_nees(one) < 7.4


def test_the_covariance_is_honest_for_errors_that_hang_together():
    def one(rng):
        T, Y = _poses(rng)
        S = np.tile(np.diag(SIGMA**2), (len(T), 1, 1)) * np.linspace(0.1, 3.0, len(T))[:, None, None]
        N = np.tile(np.diag((SIGMA / 3) ** 2), (len(T), 1, 1))
        u = rng.normal(0, 1, 6) * SIGMA
        e = np.array(
            [
                np.sqrt(grown) * np.concatenate([R.T @ u[:3], R.T @ u[3:]])
                for grown, R in zip(np.linspace(0.1, 3.0, len(T)), T[:, :3, :3], strict=True)
            ]
        )
        white = rng.normal(0, 1, (len(T), 6)) * SIGMA / 3
        return _nees(align_poses(T, Y @ _spoilt(_spoilt(T, e), white), PoseErrors(N, S)), Y)

    assert 4.6 < _mean_nees(one) < 7.4


def test_drift_that_walks_at_random_is_not_taken_too_lightly():
    """Treated as independent, such errors make the alignment look many times surer than it is."""
    values = {"shared": [], "independent": []}
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        T, Y = _poses(rng)
        steps = rng.normal(0, 1, (len(T), 6)) * SIGMA
        drift = np.cumsum(steps, axis=0)
        e = np.column_stack([(T[:, :3, :3].transpose(0, 2, 1) @ d[:, :, None])[:, :, 0] for d in np.split(drift, 2, 1)])
        S = np.tile(np.diag(SIGMA**2), (len(T), 1, 1)) * np.arange(1, len(T) + 1)[:, None, None]
        N = np.tile(np.diag((SIGMA / 100) ** 2), (len(T), 1, 1))
        truth = Y @ _spoilt(T, e)
        values["shared"].append(_nees(align_poses(T, truth, PoseErrors(N, S)), Y))
        values["independent"].append(_nees(align_poses(T, truth, PoseErrors(N + S)), Y))
    assert 2.0 < np.mean(values["shared"]) < 7.4
    assert np.mean(values["independent"]) > 12.0


def test_an_uncertain_hand_eye_makes_the_alignment_as_uncertain():
    H = np.diag(np.square([0.01, 0.01, 0.01, 0.02, 0.02, 0.02]))
    known, unknown = [], []
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        T, Y = _poses(rng)
        S = np.tile(np.diag(SIGMA**2), (len(T), 1, 1))
        truth = Y @ _spoilt(T, rng.normal(0, 1, (len(T), 6)) * SIGMA) @ se3.exp(rng.multivariate_normal(np.zeros(6), H))
        known.append(_nees(align_poses(T, truth, PoseErrors(S, hand_eye=H)), Y))
        unknown.append(_nees(align_poses(T, truth, PoseErrors(S)), Y))
    assert 4.6 < np.mean(known) < 7.4
    assert np.mean(unknown) > 12.0


def test_orientations_align_what_positions_cannot():
    """A camera that only turns: a millimetre of noise on positions turns the alignment by them by many degrees."""
    rng = np.random.default_rng(1)
    T, Y = _poses(rng, metres=0.001)
    S = np.tile(np.diag(SIGMA**2), (len(T), 1, 1))
    truth = Y @ _spoilt(T, rng.normal(0, 1, (len(T), 6)) * SIGMA)

    def off_deg(T_truth_estimate):
        return np.degrees(Rotation.from_matrix(Y[:3, :3].T @ T_truth_estimate[:3, :3]).magnitude())

    assert off_deg(align(T[:, :3, 3], truth[:, :3, 3]).T_truth_estimate) > 10.0
    assert off_deg(align_poses(T, truth, PoseErrors(S)).T_truth_estimate) < 0.3
    learnt = align_poses_alike(T, truth)
    assert off_deg(learnt.T_truth_estimate) < 0.3
    assert off_deg(learnt.T_truth_estimate) < 3.0 * np.degrees(learnt.sigma_rad) < 3.0


def test_with_infinite_variances_of_the_orientations_it_is_the_alignment_by_positions():
    rng = np.random.default_rng(2)
    T, Y = _poses(rng)
    truth = Y @ _spoilt(T, rng.normal(0, 1, (len(T), 6)) * 5.0 * SIGMA)
    S = np.tile(np.diag([0.01**2] * 3 + [np.inf] * 3), (len(T), 1, 1))
    found = align_poses(T, truth, PoseErrors(S))
    assert np.abs(found.T_truth_estimate - align(T[:, :3, 3], truth[:, :3, 3]).T_truth_estimate).max() < 1e-7


def test_a_pose_that_claims_little_counts_little():
    rng = np.random.default_rng(3)
    T, Y = _poses(rng)
    S = np.tile(np.diag(SIGMA**2), (len(T), 1, 1))
    S[0] *= 1e6
    truth = Y @ T
    truth[0] = truth[0] @ se3.exp(np.array([2.0, 1.0, 0.0, 0.5, 0.5, 0.0]))
    found = align_poses(T, truth, PoseErrors(S))
    assert np.abs(pose_errors(found.T_truth_estimate, T[1:], truth[1:])).max() < 1e-5


def test_what_cannot_be_aligned_is_refused():
    rng = np.random.default_rng(4)
    T, Y = _poses(rng)
    S = np.tile(np.diag([0.01**2] * 3 + [np.inf] * 3), (len(T), 1, 1))
    T[:, :3, 3] = np.linspace(0.0, 1.0, len(T))[:, None] * np.array([1.0, 2.0, 3.0])
    with pytest.raises(InputError, match="do not determine"):
        align_poses(T, Y @ T, PoseErrors(S))
    with pytest.raises(InputError, match="positive definite"):
        align_poses(T, Y @ T, PoseErrors(np.zeros((len(T), 6, 6))))
    with pytest.raises(InputError, match="give n x 4 x 4"):
        align_poses(T, Y @ T[:-1], PoseErrors(S))


def test_the_command_aligns_a_turning_camera_by_what_its_recording_claims(tmp_path):
    """Beside evo's figures, which turn such a camera's path by tens of degrees, and only for those of the path."""
    rng = np.random.default_rng(5)
    T, Y = _poses(rng, metres=0.001, count=240)
    stamps = 1000 * 10**9 + np.arange(len(T)) * 33_333_333
    estimate = _spoilt(T, rng.normal(0, 1, (len(T), 6)) * SIGMA)
    with RecordingWriter(tmp_path / "session.mcap") as writer:
        for stamp, E, Q in zip(stamps.tolist(), estimate, Y @ T, strict=True):
            writer.write(encode_pose("truth/camera/pose", Stamp(stamp), Q, "world"))
            writer.write(encode_odometry("cam0/odom", Stamp(stamp), E, np.diag(SIGMA**2), "odom", "camera"))
            writer.write(encode_pose("cam0/pose", Stamp(stamp), E, "map"))
    out = tmp_path / "errors.json"
    done = CliRunner().invoke(app, ["eval", str(tmp_path / "session.mcap"), "--json", str(out)])
    assert done.exit_code == 0, done.output
    assert "covariances claimed" in done.output
    figures = json.loads(out.read_text())["pose_alignment"]
    assert figures["rmse_deg"] == pytest.approx(np.degrees(SIGMA[3] * np.sqrt(3.0)), rel=0.1)
    assert figures["rmse_m"] == pytest.approx(SIGMA[0] * np.sqrt(3.0), rel=0.1)
    assert 0.3 < figures["sigma_deg"] < 2.0
