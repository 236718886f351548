"""How sure the numbers of a fit are, where neighbouring errors hang together."""

import numpy as np

from odom.backend.tracking.tuning import TUNING as TRACKING
from odom.calibration.adjustment import Fit, Prior, System, camera_arrays, places
from odom.calibration.normal_equations import scores_of
from odom.calibration.survey import Survey
from odom.calibration.tuning import TUNING
from odom.evaluation.sandwich import sandwich_sigma
from odom.geometry.arrays import Array


def sigmas(survey: Survey, fitted: Fit, prior: Prior) -> Array:
    """Return the standard deviations (p) of the fit's free numbers.

    Each is the larger of two sandwich estimates, whose blocks are stretches of time and neighbouring landmarks: a
    depth image errs alike for a second, and a landmark that was chosen badly errs in every frame.
    """
    system = System.of(survey, fitted.vector, fitted.bundle, fitted.free)
    follows = system.follows(len(fitted.free))
    information = system.information(prior.sigma[fitted.free] ** -2.0, follows)
    scores = scores_of(
        follows, system.V_inverse, system.W_number, system.W, fitted.bundle.T_camera_map, fitted.bundle.landmarks,
        camera_arrays(survey, fitted.vector, fitted.free), places(survey), survey.arrays, TRACKING.cauchy_chi2,
    )  # fmt: skip
    by_time = np.argsort(survey.seconds[survey.frame], kind="stable")
    return np.maximum(
        sandwich_sigma(information, scores[by_time], TUNING.sure_blocks),
        sandwich_sigma(information, scores, TUNING.sure_blocks),
    )
