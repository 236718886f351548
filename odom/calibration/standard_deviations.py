"""Standard deviations of the fitted parameters when neighbouring errors are correlated."""

import numpy as np

from odom.backend.tracking.tuning import TUNING as TRACKING
from odom.calibration.adjustment import Prior, System, camera_arrays, places
from odom.calibration.normal_equations import scores_of
from odom.calibration.tuning import TUNING
from odom.evaluation.sandwich import sandwich_sigma
from odom.geometry.arrays import Array


def sigmas(system: System, prior: Prior) -> Array:
    """Return the standard deviations (p) of the free parameters at the end of a fit.

    Each is the larger of two sandwich estimates, whose blocks are stretches of time and neighbouring landmarks: the
    errors of depth images stay alike for a second, and a badly chosen landmark is wrong in every frame.
    """
    survey, free = system.survey, system.free
    information, follows = system.information(prior), np.ascontiguousarray(system.follow(np.eye(len(free))))
    scores = scores_of(
        follows, system.V_inverse, system.W_camera, system.W, system.T_camera_map, system.landmarks,
        camera_arrays(survey, system.vector), free, places(survey), survey.arrays, TRACKING.cauchy_chi2,
    )  # fmt: skip
    by_time = np.argsort(survey.seconds[survey.frame], kind="stable")
    return np.maximum(
        sandwich_sigma(information, scores[by_time], TUNING.sure_blocks),
        sandwich_sigma(information, scores, TUNING.sure_blocks),
    )
