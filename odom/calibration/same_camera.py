"""Whether two parts of the measurements come from the same camera."""

import numpy as np

from odom.calibration.parameters import LENS, NAMES
from odom.calibration.result import Calibrated
from odom.calibration.survey import Survey
from odom.calibration.tuning import TUNING
from odom.geometry.arrays import Array

_LENS = np.arange(LENS.start, LENS.stop)
_CENTRED = _LENS[:4]
"""Focal lengths and centre, which a user knows by name."""


def apart(one: Calibrated, other: Calibrated) -> float:
    """Return by how many sigma, root mean square, two cameras' lenses differ, in the parameters that both have shown.

    The parameters' errors are correlated, so that lenses may differ surely although no single one does.
    """
    both = _LENS[(one.shown & other.shown)[_LENS]]
    if not len(both):
        return 0.0
    off = (one.vector - other.vector)[both]
    covariance = (_covariance(one) + _covariance(other))[np.ix_(both, both)]
    return float(np.sqrt(off @ np.linalg.solve(covariance, off) / len(both)))


def most_different(one: Calibrated, other: Calibrated) -> tuple[int, float]:
    """Return the focal length or coordinate of the centre that differs by the most sigma, and by how many."""
    sigmas = np.abs(one.vector - other.vector) / np.hypot(one.sigma, other.sigma)
    at = int(_CENTRED[np.argmax(np.where(one.shown & other.shown, sigmas, 0.0)[_CENTRED])])
    return at, float(sigmas[at]) if one.shown[at] and other.shown[at] else 0.0


def is_of_another_camera(found: Calibrated) -> bool:
    """Return whether the focal length is farther from the one given than any calibration of this camera would be.

    From such a start the result does not settle: prior and linearisation are those of another camera.
    """
    now, given = found.vector[_CENTRED[:2]], found.start[_CENTRED[:2]]
    return bool(np.abs(np.log(now / given)).max() > TUNING.other_camera * TUNING.prior_focal)


def halves(survey: Survey) -> tuple[Survey, Survey]:
    """Return the survey of the earlier frames and that of the later ones."""
    is_late = survey.seconds > np.median(survey.seconds)
    return survey.of_frames(~is_late), survey.of_frames(is_late)


def _covariance(found: Calibrated) -> Array:
    """Return the covariance (30 x 30) of all parameters of a calibration, 0 for those that were not adjusted."""
    free, covariance = found.fitted.free, np.zeros((len(NAMES), len(NAMES)))
    covariance[np.ix_(free, free)] = found.covariance
    return covariance
