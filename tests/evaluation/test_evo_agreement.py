"""The numbers of this package against evo's, on the same matched poses."""

import copy

import numpy as np
import pytest
from evo.core import metrics as evo_metrics
from evo.core.trajectory import PoseTrajectory3D

from odom.evaluation import EvaluationOptions, Trajectory, evaluate
from odom.evaluation.files import read_tum
from odom.evaluation.metrics import pairs_apart
from odom.geometry import se3


def noisy(truth: Trajectory, stamps, seed=0) -> Trajectory:
    """A drifting estimate in another world, at the stamps where truth is known."""
    rng = np.random.default_rng(seed)
    poses, valid = truth.at(stamps, 0.1)
    poses, stamps = poses[valid], stamps[valid]
    drift = np.cumsum(rng.normal(0, 0.003, (len(stamps), 6)), axis=0)
    T_other_world = se3.exp(rng.normal(0, 1.0, 6))
    return Trajectory(stamps, np.array([T_other_world @ T @ se3.exp(x) for T, x in zip(poses, drift, strict=True)]))


def to_evo(trajectory: Trajectory) -> PoseTrajectory3D:
    return PoseTrajectory3D(poses_se3=list(trajectory.T_world_body.copy()), timestamps=trajectory.stamps * 1e-9)


@pytest.fixture(scope="module")
def fr1_xyz(shared_data) -> tuple[Trajectory, Trajectory]:
    folder = shared_data / "tum_fr1_xyz"
    truth = read_tum(folder / "groundtruth.txt")
    lines = [line.split()[0] for line in (folder / "rgb.txt").read_text().splitlines() if not line.startswith("#")]
    return noisy(truth, np.array([round(float(text) * 1e9) for text in lines])), truth


def test_ate_and_rpe_agree_with_evo(fr1_xyz):
    estimate, truth = fr1_xyz
    report = evaluate(estimate, truth, EvaluationOptions())
    poses, valid = truth.at(estimate.stamps, 0.1)
    reference = to_evo(Trajectory(estimate.stamps[valid], poses[valid]))
    aligned = to_evo(estimate.take(valid))
    assert report.matched == len(reference.timestamps)
    plain = copy.deepcopy(aligned)
    aligned.align(reference, correct_scale=False)

    ape = evo_metrics.APE(evo_metrics.PoseRelation.translation_part)
    ape.process_data((reference, aligned))
    assert report.ate_m == pytest.approx(ape.get_statistic(evo_metrics.StatisticsType.rmse), abs=1e-9)

    steps = np.diff(estimate.stamps[valid])
    for relation, ours in (
        (evo_metrics.PoseRelation.translation_part, report.rpe_frame.rmse_m),
        (evo_metrics.PoseRelation.rotation_angle_deg, report.rpe_frame.rmse_deg),
    ):
        rpe = evo_metrics.RPE(relation, delta=1, delta_unit=evo_metrics.Unit.frames, all_pairs=True)
        rpe.process_data((reference, plain))
        errors = rpe.error[steps < 1.5 * np.median(steps)]  # evo counts a step over a hole too
        assert ours == pytest.approx(np.sqrt(np.mean(np.square(errors))), abs=1e-6)

    earlier, later = pairs_apart(estimate.stamps[valid], 1.0, 0.025)
    for relation, ours in (
        (evo_metrics.PoseRelation.translation_part, report.rpe_1s.rmse_m),
        (evo_metrics.PoseRelation.rotation_angle_deg, report.rpe_1s.rmse_deg),
    ):
        errors = []
        for i, j in zip(earlier, later, strict=True):
            E = evo_metrics.RPE.rpe_base(
                reference.poses_se3[i], reference.poses_se3[j], plain.poses_se3[i], plain.poses_se3[j]
            )
            errors.append(
                np.linalg.norm(E[:3, 3])
                if relation is evo_metrics.PoseRelation.translation_part
                else np.degrees(np.linalg.norm(se3.so3_log(E[:3, :3])))
            )
        assert len(errors) == report.rpe_1s.pairs > 500
        assert ours == pytest.approx(np.sqrt(np.mean(np.square(errors))), abs=1e-6)
