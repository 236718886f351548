"""A biased axis shows in the twelve states: if one axis of a sensor reads too long, the affine map is no rigid motion.

The recursion estimates an affine map. Six directions of its states are no rigid motion, and their noise is known. Where
they exceed it, the map may be `[D R | D t]` (an axis of the target is scaled, `D` diagonal) or `[R D | t]` (one of the
source), and its projection gives the scale.
"""

import math
from dataclasses import dataclass
from enum import Enum, unique

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.se3 import exp
from odom.registration.checked_arrays import Arrays
from odom.registration.paper.noise_adaptation import FULL
from odom.registration.paper.tuning import TUNING
from odom.registration.solution import Solution
from odom.registration.weighted_projection import tangent_basis

_SUFFICIENT = 20.5
"""The .999 quantile of chi-square with 5 degrees of freedom."""
_OUTSTANDING = 37.7
"""The .99 quantile of Fisher's F with 1 and 5 degrees of freedom, for the best of six axes."""


@unique
class Side(Enum):
    """Which cloud an axis belongs to."""

    SOURCE = "source"
    TARGET = "target"


@dataclass(frozen=True)
class Bias:
    """One axis (0, 1, 2) of one side reads `scale` times the truth."""

    side: Side
    axis: int
    scale: float


def possible_biases(solution: Solution, misfit: float, factor: float) -> list[Bias]:
    """Return the biased axes that could explain why the twelve states are no rigid motion, the best first.

    `misfit` is their squared distance from it, `factor` the variance of the noise relative to that of `solution`. Empty
    where no single axis suffices, or the twelve states are not determined. Whatever the noise, the misfit that an axis
    explains must stand out from the misfit left in the other five directions: errors that neighbouring pairs share (a
    shutter, a lens, late depth) distort all six, and then the largest is no biased axis.
    """
    if np.linalg.cond(solution.Y) > 1e12:
        return []
    found = [_projected(solution, side, axis) for side in Side for axis in range(3)]
    return [
        bias
        for bias, rest in sorted(found, key=lambda item: item[1])
        if rest < _SUFFICIENT * factor
        and misfit - rest > _OUTSTANDING * rest / 5.0
        and abs(math.log(max(bias.scale, 1e-9))) < math.log(1.0 + TUNING.plausible_axis_error)
    ]


def source_noise(Sq: Array, solution: Solution) -> Array:
    """Return the part of Y (12 x 12) that is only the noise of the source points: `sum W (x) Sq`.

    The states are found between two noisy clouds, so it is `Y - this` that weighs the twelve states as a free affine
    map: otherwise the map shrinks, by the noise over the spread of the points, which counts where there are thousands.
    """
    W = solution.W[:, FULL] * solution.weights[:, None]
    out = np.zeros((3, 4, 3, 4))
    out[:, :3, :, :3] = (W.T @ Sq.reshape(-1, 9)).reshape(3, 3, 3, 3).transpose(0, 2, 1, 3)
    return out.reshape(12, 12)


def unbiased(arrays: Arrays, bias: Bias) -> Arrays:
    """Return the pairs with the biased axis set right."""
    D = np.ones(3)
    D[bias.axis] = 1.0 / bias.scale
    if bias.side is Side.TARGET:
        return arrays._replace(p=arrays.p * D, Sp=arrays.Sp * D[:, None] * D)
    return arrays._replace(q=arrays.q * D, Sq=arrays.Sq * D[:, None] * D)


def bias_information(solution: Solution, bias: Bias) -> Array:
    """Return the information (6 x 6) that is left of `H` when the axis' scale is unknown too: Schur's complement.

    `solution` is that of the unbiased pairs.
    """
    B = _basis(solution.T, bias.side, bias.axis, 1.0)
    cross = B.T @ solution.Y @ B
    return np.asarray(solution.H - np.outer(cross[:6, 6], cross[6, :6]) / cross[6, 6])


def _basis(T: Array, side: Side, axis: int, scale: float) -> Array:
    """Return d x / d(rho, phi, scale) (12 x 7) of the map with one axis scaled."""
    rigid = np.empty((12, 6))
    tangent_basis(T, rigid)
    rows = rigid.reshape(3, 4, 6).copy()
    last = np.zeros((3, 4))
    if side is Side.TARGET:
        rows[axis] *= scale
        last[axis] = T[axis]
    else:
        rows[:, axis] *= scale
        last[:, axis] = T[:3, axis]
    return np.concatenate([rows.reshape(12, 6), last.reshape(12, 1)], axis=1)


def _projected(solution: Solution, side: Side, axis: int) -> tuple[Bias, float]:
    """Return the projection with one axis scaled, by Gauss-Newton in the metric of Y, and the squared distance left."""
    T, scale = solution.T.copy(), 1.0
    Y, y = solution.Y, solution.y
    for _ in range(10):
        X = T[:3].copy()
        if side is Side.TARGET:
            X[axis] *= scale
        else:
            X[:, axis] *= scale
        B = _basis(T, side, axis, scale)
        H = B.T @ Y @ B
        step = np.linalg.solve(H, B.T @ (y - Y @ X.ravel()))
        T, scale = T @ exp(np.asarray(step[:6], dtype=np.float64)), scale + float(step[6])
        if float(step @ H @ step) < 1e-12:
            break
    e = np.linalg.solve(Y, y) - X.ravel()
    return Bias(side, axis, scale), float(e @ Y @ e)
