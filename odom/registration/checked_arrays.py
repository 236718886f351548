"""The arrays of point pairs, checked, as the compiled loops take them."""

from typing import NamedTuple

import numpy as np

from odom.errors import InputError
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled
from odom.registration.pairs import Pairs

NO_COVARIANCES = np.empty((0, 3, 3))
"""Points without noise."""

_FARTHEST_M = 1e5
"""m; all points of a cloud may be so far along an axis: with a noise of 1 mm NEES is 6 there, 7 at three times the
distance, and hundreds at 5000 km with a noise of 1 cm. Sums of squares lose the digits of the noise."""


class Arrays(NamedTuple):
    """The checked arrays of n pairs: points (n x 3, m), covariances (n x 3 x 3, or of length 0) and weights (n)."""

    q: Array
    p: Array
    Sq: Array
    Sp: Array
    weights: Array


@compiled
def unusable(q: Array, p: Array, weights: Array, farthest_m: float) -> int:
    """Return 0, or 1 when points are not all finite, 2 when weights are not all finite and at least 0.

    3 or 4 when all points of `q`, or of `p`, are farther than `farthest_m` from the origin along an axis.
    """
    points = total = 0.0
    nearest_q = nearest_p = np.inf
    for k in range(len(q)):  # 0 times a number is 0, unless it is infinite or no number
        points += 0.0 * (q[k, 0] + q[k, 1] + q[k, 2] + p[k, 0] + p[k, 1] + p[k, 2])
        total += 0.0 * np.sqrt(weights[k])
        nearest_q = min(nearest_q, max(abs(q[k, 0]), abs(q[k, 1]), abs(q[k, 2])))
        nearest_p = min(nearest_p, max(abs(p[k, 0]), abs(p[k, 1]), abs(p[k, 2])))
    if points != 0.0 or total != 0.0:
        return 1 if points != 0.0 else 2
    if len(q) == 0:
        return 0
    return 3 if nearest_q > farthest_m else 4 if nearest_p > farthest_m else 0


def finite(pairs: Pairs, farthest_m: float = np.inf) -> Arrays:
    """Return the arrays of `pairs`; raises InputError unless all points and weights can be used.

    All points of a cloud may be `farthest_m` from the origin along an axis.
    """
    if not isinstance(pairs, Pairs):
        raise InputError(f"{type(pairs).__name__} given: give Pairs(source, target, their covariances or None)")
    weights = np.ones(len(pairs)) if pairs.weights is None else pairs.weights
    match unusable(pairs.points_source, pairs.points_target, weights, farthest_m):
        case 1:
            raise InputError("points are not all finite: leave out pairs without a measurement")
        case 2:
            raise InputError("weights must be finite and not negative")
        case 3 | 4 as which:
            what = f"all {'source' if which == 3 else 'target'} points are more than {farthest_m / 1e3:.0f} km from"
            raise InputError(f"{what} the origin, too far to tell their noise: subtract one of each cloud from them")
    Sq = NO_COVARIANCES if pairs.covariances_source is None else pairs.covariances_source
    Sp = NO_COVARIANCES if pairs.covariances_target is None else pairs.covariances_target
    return Arrays(pairs.points_source, pairs.points_target, Sq, Sp, weights)


def checked(pairs: Pairs) -> Arrays:
    """Return the arrays of `pairs` as `finite` does.

    Raises InputError too when there are no covariances at all, and when a cloud lies so far from the origin that sums
    of squares lose the digits of its noise.
    """
    arrays = finite(pairs, _FARTHEST_M)
    if pairs.covariances_source is None and pairs.covariances_target is None:
        raise InputError("the pairs have no covariances: give those of a noise model for at least one side")
    return arrays
