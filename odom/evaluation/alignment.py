"""Alignment of two point sets in time by a rigid motion (never a scale).

S. Umeyama, "Least-squares estimation of transformation parameters between two point patterns", PAMI 1991, with c = 1.
"""

from dataclasses import dataclass

import numpy as np

from odom.errors import InputError
from odom.geometry.arrays import Array
from odom.geometry.rotations import turn_onto

_MINIMUM = 3
"""Points that determine a rotation."""
_STRAIGHT = 0.02
"""Spread across a path, as a share of that along it, below which positions do not determine the turn about it."""
_STILL_M = 0.005
"""Spread of positions below which noise of truth and estimate decides about the rotation."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """The motion that maps estimated positions onto true ones; `notes` say in words what they do not determine."""

    T_truth_estimate: Array
    notes: tuple[str, ...]


def align(points_estimate: Array, points_truth: Array) -> Alignment:
    """Return the least-squares rigid motion from n x 3 estimated points to n x 3 true ones (Umeyama's eqs. 38-42).

    Raises InputError for fewer than three pairs or unequal shapes.
    """
    if points_estimate.shape != points_truth.shape or points_truth.ndim != 2 or points_truth.shape[1] != 3:
        raise InputError(f"cannot align {points_estimate.shape} with {points_truth.shape}: give two n x 3 arrays")
    if len(points_truth) < _MINIMUM:
        raise InputError(f"{len(points_truth)} matched poses: an alignment needs {_MINIMUM} at least")
    mean_e, mean_t = points_estimate.mean(axis=0), points_truth.mean(axis=0)
    T = np.eye(4)
    T[:3, :3] = turn_onto(points_estimate - mean_e, points_truth - mean_t)
    T[:3, 3] = mean_t - T[:3, :3] @ mean_e
    spread = np.linalg.svd(points_truth - mean_t, compute_uv=False) / np.sqrt(len(points_truth))
    return Alignment(T, _degeneracy(spread))


def _degeneracy(spread_m: Array) -> tuple[str, ...]:
    """Return the notes for the standard deviations of true positions along their principal axes, largest first."""
    if spread_m[0] < _STILL_M:
        return (
            f"the true positions spread only {spread_m[0] * 1e3:.1f} mm: the alignment's rotation is arbitrary "
            "and the absolute error says little; judge by the relative rotation error",
        )
    if spread_m[1] < _STRAIGHT * spread_m[0] or spread_m[1] < _STILL_M / 5:
        return (
            f"the true path is a straight line (spread {spread_m[0]:.3f} m along it, {spread_m[1]:.4f} m across): "
            "the rotation about the line is not determined by positions; errors in that angle do not show in the ATE",
        )
    return ()
