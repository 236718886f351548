"""Whether a loop closure agrees with the chain of key frames between its ends.

That is the path of the map's registrations between them, not the paper's chain of frames (`odom.backend.chain`), whose
closures are judged in the same way.
"""

import numpy as np

from odom.backend.loop_closure.graph import SegmentGraph
from odom.backend.loop_closure.tuning import TUNING
from odom.backend.map.keyframe import Keyframe
from odom.backend.map.pose_covariance import calibration_covariance, independent_covariance
from odom.backend.map.pose_graph import Edge
from odom.geometry import se3
from odom.geometry.arrays import Array

_CHI2_6_9999 = 27.86
"""The .9999 quantile of chi-squared with 6 degrees of freedom."""


def contradiction(graph: SegmentGraph, closure: Edge, calibration_error: float) -> str:
    """Return how a `closure` contradicts the chain of key frames between its ends; empty where it does not.

    `calibration_error` is the share of a motion by which the chain may err as a whole.
    """
    if not graph.holds(closure):
        return "one of its key frames is no longer in this part of the map"
    chain = graph.covariance_between(closure.a, closure.b)
    if chain is None:
        return ""
    return disagreement(graph.T_between(closure.a, closure.b), chain, closure, calibration_error)


def contradiction_from_start(a: Keyframe, b: Keyframe, closure: Edge, calibration_error: float) -> str:
    """Return how a `closure` of key frames `a` and `b` contradicts the chain by way of its first key frame.

    Empty where it does not, or where they are of two chains. That path is seldom surer than the surest one, which
    `contradiction` takes: nearly all that is refused here would be refused there.
    """
    if a.first != b.first:
        return ""
    T_a_b = a.T_camera_map @ se3.inverse(b.T_camera_map)
    A = se3.adjoint(se3.inverse(T_a_b))
    chain = b.covariance_since_start + A @ a.covariance_since_start @ A.T
    return disagreement(T_a_b, chain, closure, calibration_error)


def disagreement(T_a_b: Array, chain: Array, closure: Edge, calibration_error: float) -> str:
    """Return how a `closure` disagrees with a chain's T_a_b, of covariance `chain` (6 x 6); empty if it agrees.

    `calibration_error` is the share of a motion by which the chain may err as a whole.
    """
    away = se3.log(se3.inverse(T_a_b) @ closure.T_a_b)
    S = chain + calibration_covariance(T_a_b, calibration_error) + independent_covariance(closure.covariance)
    chi2 = float(away @ np.linalg.solve(S * TUNING.chain_sigma_scale**2 + 1e-12 * np.eye(6), away))
    if chi2 <= _CHI2_6_9999:
        return ""
    metres, degrees = np.linalg.norm(away[:3]), np.rad2deg(np.linalg.norm(away[3:]))
    return f"contradicts the chain by {metres:.2f} m and {degrees:.1f} deg ({np.sqrt(chi2):.0f} sigma)"
