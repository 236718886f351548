"""The unit of length after a calibration, which neither images nor depth show.

With steps, landmarks and depth longer by one factor, everything looks the same. So a fit to images must not change the
unit as a side effect: corrections of depth that grow or fall with range would, and so does a longer focal length, which
makes steps to the side smaller. What was known of the unit before decides.
"""

from dataclasses import replace

import numpy as np

from odom.calibration.parameters import BASELINE, OFFSET, SCALE, SCALE_NUMBER, camera_of, vector_of
from odom.calibration.result import Calibrated
from odom.calibration.survey import Survey
from odom.calibration.tuning import TUNING
from odom.evaluation.diagnosis.scale import ScaleFit
from odom.frame import Camera
from odom.frontend.camera.rays import rays_of, turned_onto
from odom.geometry.arrays import Array

_LEAST_INVERSE = 1e-3
"""Least inverse depth (1/m) after a correction: that of a kilometre."""


def in_unit_of_depth(result: Calibrated, survey: Survey) -> Calibrated:
    """Return a calibration that leaves the depth of the usual observation as it was by the calibration given."""
    return _scaled(result, float(np.exp(-depth_change(result, survey))))


def in_metres(result: Calibrated, survey: Survey, scale: ScaleFit) -> Calibrated:
    """Return a calibration in the unit that is expected where motion capture saw the camera's way.

    By Bayes' rule: depth's own unit is known beforehand, the ratio `scale` of the survey's displacements to the true
    ones is measured, and each counts with its variance. A ratio that a short way hardly shows so moves the unit little.
    """
    kept, own, seen = in_unit_of_depth(result, survey), TUNING.prior_unit, scale.sigma / scale.ratio
    weight = own**2 / (own**2 + seen**2)
    before, measured = kept.vector[SCALE_NUMBER], vector_of(survey.camera)[SCALE_NUMBER] / scale.ratio
    sigma, shown = result.sigma.copy(), result.shown.copy()
    sigma[SCALE_NUMBER] = np.sqrt(weight) * seen
    shown[SCALE_NUMBER] = sigma[SCALE_NUMBER] < TUNING.shown_share * own
    return replace(_scaled(kept, 1.0 + weight * float(measured / before - 1.0)), sigma=sigma, shown=shown)


def in_believed_unit(result: Calibrated, survey: Survey) -> Calibrated:
    """Return a calibration in the unit that is expected where nothing was measured against a metre.

    Where the focal length is found to be longer by a share d, depth's unit may be right, and walks shorter by d than
    the calibration given made them. Or the walks' size was right: whoever calibrates depth by a board of known size
    uses the focal length that he believes in, so that the errors of both cancel. The expected unit lies between.
    """
    lens = lens_change(camera_of(result.start, result.camera), result.camera, survey)
    return _scaled(result, float(np.exp(-depth_change(result, survey) - size_belief(lens) * lens)))


def size_belief(lens: float) -> float:
    """Return the probability that the size was right where the lens changes by `lens` (natural logarithm).

    By Bayes' rule, even odds beforehand: then depth's unit was off by so much, else the focal length was, and its prior
    is the wider one. Small changes let the size be, large ones are the focal length's.
    """
    unit, focal = TUNING.prior_field, TUNING.prior_focal
    odds = focal / unit * np.exp(-0.5 * lens**2 * (unit**-2.0 - focal**-2.0))
    return float(odds / (1.0 + odds))


def depth_change(result: Calibrated, survey: Survey) -> float:
    """Return the median change of depth over a survey's observations, a natural logarithm; 0 without depth."""
    has_depth = survey.inverse_depth > 0.0
    if not has_depth.any():
        return 0.0
    terms, measured = survey.terms[has_depth], survey.inverse_depth[has_depth]

    def inverse(vector: Array) -> Array:
        return np.maximum((measured - terms @ vector[OFFSET]) / (terms @ vector[SCALE]), _LEAST_INVERSE)

    return float(np.median(np.log(inverse(result.start) / inverse(result.vector))))


def lens_change(given: Camera, camera: Camera, survey: Survey) -> float:
    """Return how much wider `camera` sees what a survey saw than the one `given`: a logarithm, by the spread of rays.

    A longer lens gives a negative one: the same pixels are seen closer together, and steps to the side are smaller.
    """
    before = rays_of(given, survey.uv)
    found = turned_onto(rays_of(camera, survey.uv), before)
    a, b = (rays[:, :2] / rays[:, 2:] for rays in (before, found))
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    return float(np.log((a * b).sum() / (a * a).sum()))


def _scaled(result: Calibrated, factor: float) -> Calibrated:
    """Return a calibration by which all lengths are `factor` times as long, with the same images."""
    vector = result.vector.copy()
    vector[SCALE] *= factor
    vector[BASELINE] *= factor
    return replace(result, camera=camera_of(vector, result.camera), vector=vector)
