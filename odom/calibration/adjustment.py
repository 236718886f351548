"""All poses and landmarks of a survey and the camera's numbers, adjusted together (Gauss-Newton, robust)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from odom.backend.mapping.bundle_adjustment import Bundle, adjust
from odom.calibration.linearised import linearised
from odom.calibration.parameters import NAMES, SCALE_NUMBER, vector_of
from odom.calibration.survey import Survey
from odom.calibration.tuning import TUNING
from odom.geometry.arrays import Array, Index

FREE = np.array([k for k in range(len(NAMES)) if k != SCALE_NUMBER])
"""The numbers that images and depth can show; the scale of depth needs motion capture."""


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of the camera's numbers beforehand: `mean` and `sigma` (28)."""

    mean: Array
    sigma: Array


@dataclass(frozen=True, eq=False)
class Fit:
    """An adjusted camera's `vector` (28), of which the numbers `free` (p) were adjusted, with poses and landmarks.

    `information` (p x p) is what the observations and the prior say of these, as far as errors are independent.
    """

    vector: Array
    free: Index
    information: Array
    bundle: Bundle


def start_of(survey: Survey) -> Bundle:
    """Return the poses and landmarks with which a survey begins."""
    return Bundle(survey.T_camera_map, survey.landmarks, np.zeros(0))


def fit(
    survey: Survey,
    prior: Prior,
    free: Index,
    start: Fit | None = None,
    stopped: Callable[[], bool] = lambda: False,
    rounds: int = TUNING.fit_rounds,
) -> Fit:
    """Return the camera's numbers `free` that fit a survey best; the others stay at those of `start`, or the survey's.

    It is linearised anew `rounds` times at most. Ends early, with what was found so far, once `stopped` says so.
    """
    vector = vector_of(survey.camera) if start is None else start.vector.copy()
    bundle = start_of(survey) if start is None else start.bundle
    known = np.diag(prior.sigma[free] ** -2.0)
    information = known
    for _ in range(rounds):
        change = vector[free] - prior.mean[free]
        lines = linearised(survey, vector, bundle)
        observations = lines.observations(survey, free, change)
        begin = Bundle(bundle.T_camera_map, bundle.landmarks, change)
        bundle = adjust(begin, survey.is_fixed, observations, known, TUNING.fit_steps)
        assert bundle.information_timing is not None
        information = bundle.information_timing + known
        step = bundle.timing_change - change
        vector[free] = prior.mean[free] + bundle.timing_change
        sigma = np.sqrt(np.diag(np.linalg.inv(information)))
        if stopped() or (np.abs(step) < TUNING.fit_settled * sigma).all():
            break
    return Fit(vector, free, information, bundle)
