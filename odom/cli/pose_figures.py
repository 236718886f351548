"""The line of `odom eval` about the alignment by positions and orientations."""

from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from odom.errors import InputError
from odom.evaluation.pose_alignment import PoseErrors, align_poses, align_poses_alike, figures
from odom.frame import Stamp
from odom.geometry.arrays import Array

if TYPE_CHECKING:
    from odom.evaluation import Report
    from odom.evaluation.mocap_calibration import Calibration
    from odom.evaluation.truth_noise import TruthNoise

_ENOUGH = 10
"""Poses with a covariance from which on these are used: with fewer, the size of the errors is learnt from all."""


def print_pose_figures(
    report: "Report", claims: dict[Stamp, Array], calibration: "Calibration | None", noise: "TruthNoise | None"
) -> dict[str, float] | None:
    """Print how far the poses are off after an alignment by poses, and return the figures; None where none is found.

    `claims` are the 6 x 6 covariances of the estimate where they are known; else the errors' size is learnt from them.
    """
    hand_eye = np.diag(np.square(calibration.hand_eye_sigma)) if calibration else None
    own = noise.interpolated_covariance if noise else np.zeros((6, 6))
    estimate, truth = report.estimate_aligned.T_world_body, report.truth.T_world_body
    claimed = [claims.get(Stamp(int(stamp))) for stamp in report.truth.stamps]
    known = np.array([covariance is not None for covariance in claimed])
    try:
        if known.sum() >= _ENOUGH:
            shared = np.array([covariance for covariance in claimed if covariance is not None])
            errors = PoseErrors(np.tile(own, (len(shared), 1, 1)), shared, hand_eye)
            found = align_poses(estimate[known], truth[known], errors)
        else:
            found = align_poses_alike(estimate, truth, hand_eye)
    except InputError as error:
        print(f"by poses       not aligned: {error}")
        return None
    seen = figures(found, estimate, truth)
    how = "claimed" if known.sum() >= _ENOUGH else "learnt"
    print(
        f"by poses       {seen.rmse_m:.4f} m  {seen.rmse_deg:.3f} deg off, aligned to "
        f"{seen.sigma_m:.4f} m  {seen.sigma_deg:.3f} deg (covariances {how})"
    )
    return asdict(seen)
