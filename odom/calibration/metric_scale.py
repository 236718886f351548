"""The scale of depth against motion capture: the distance covered according to depth, divided by the true one."""

from collections.abc import Mapping

import numpy as np

from odom.evaluation.diagnosis.motion import PairMotion
from odom.evaluation.diagnosis.scale import BodyTruth, ScaleFit, body_truth, fit_scale
from odom.evaluation.run_report import CAMERA
from odom.evaluation.trajectory import Trajectory
from odom.geometry import se3

_EVERY = 3
"""Pairs begin at every third frame: more say the same again."""
_APART_S = (1.0, 2.0, 4.0)
"""Seconds from the first to the second pose of a pair: longer ones drift, shorter ones hardly move. Errors that stay
the same in a walk, as of a marker's lever arm, make the ratios for these times differ."""
_MOST_TURN_SIGMA = 0.05
"""Markers are used if the camera's rotation (sigma, rad) to them is known."""
_SYSTEMATIC = 0.003
"""What the scatter of the ratio does not show (sigma, a share): rolling shutter, and the motion capture's own unit."""


def metric_scale(trajectory: Trajectory, truth: Mapping[str, Trajectory]) -> ScaleFit | None:
    """Return the ratio of measured to true displacements, None where no truth can be used or the camera hardly moved.

    Truth of a body `camera` is the camera's own; any other body's is that of markers, on a clock of its own.
    """
    whole = trajectory.longest_segment()
    for name in sorted(truth, key=lambda body: body != CAMERA):
        own = BodyTruth(truth[name], np.eye(3), True) if name == CAMERA else None
        body = own or body_truth(whole, truth[name], _MOST_TURN_SIGMA)
        fits = [] if body is None else [fit_scale(_motions(whole, apart), whole.stamps, body) for apart in _APART_S]
        found = [fit for fit in fits if fit is not None and fit.ratio > 0.0]
        if found:
            best, ratios = min(found, key=lambda fit: fit.sigma), [fit.ratio for fit in found]
            apart = max(ratios) - min(ratios)
            sigma = float(np.linalg.norm([best.sigma, apart, _SYSTEMATIC * best.ratio]))
            return ScaleFit(best.ratio, sigma, best.usual_m)
    return None


def _motions(whole: Trajectory, apart_s: float) -> list[PairMotion]:
    """Return the motions between poses `apart_s` apart."""
    none, nothing = np.zeros(0), np.zeros((0, 2))
    motions = []
    for earlier in range(0, len(whole), _EVERY):
        later = int(np.searchsorted(whole.stamps, whole.stamps[earlier] + round(apart_s * 1e9)))
        if later < len(whole):
            T = se3.inverse(whole.T_world_body[later]) @ whole.T_world_body[earlier]
            motions.append(PairMotion(earlier, later, T, nothing, none, nothing, none, apart_s))
    return motions
