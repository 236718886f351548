"""Two neighbouring links share the errors of the frame between them, which enter both, with opposite signs.

A link is, to first order, linear in what its two frames measured: feature k moves it by `G_k e_k`, where e_k is the
error of the values (x/z, y/z, 1/z). So two links with frame i between them have the covariance `sum_k G_k S_k G'_k^T`,
where G and G' are the gains of frame i in the two links. A chain of them is a moving average of the first order: only
neighbours are correlated, and the recursion needs no state but the gains of the newest frame.
"""

from dataclasses import dataclass

import numpy as np

from odom.backend.tracking.pose_solver import PoseFit, projected, robust_information
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.rolling_shutter import interaction_matrix
from odom.frontend.features.measurement import Measurements
from odom.geometry.arrays import Array, Index, Mask
from odom.geometry.compiled import compiled
from odom.geometry.numbered import shared


@dataclass(frozen=True, eq=False)
class FrameErrors:
    """What the errors of a frame's m features, by their `names`, have done to the link that ends there.

    `moved` (m x 6 x 3) is the covariance of the link's error with that of each feature's values.
    """

    names: Index
    moved: Array

    @classmethod
    def nothing(cls) -> "FrameErrors":
        """Return the errors of a frame at which no link ends."""
        return cls(np.zeros(0, dtype=np.int64), np.zeros((0, 6, 3)))

    @classmethod
    def of(cls, names: Index, measured: Measurements, gains: Array) -> "FrameErrors":
        """Return those of n features as they were `measured`, which enter the link by `gains` (n x 6 x 3)."""
        return cls(names, _moved(gains, measured.covariance))

    def shared_with(self, names: Index, gains: Array) -> Array:
        """Return the covariance (6 x 6) of this link's error with the next one's, which features enter by `gains`."""
        here, there = shared(self.names, names)
        return _added_up(self.moved, here, gains, there)


@compiled
def _moved(gains: Array, covariance: Array) -> Array:
    """Return G S (n x 6 x 3): of `gains` G (n x 6 x 3), and the `covariance` (n x 4, see `Measurements`) of values."""
    out = np.empty_like(gains)
    for k in range(len(gains)):
        xx, xy, yy, ww = covariance[k, 0], covariance[k, 1], covariance[k, 2], covariance[k, 3]
        ww = 0.0 if np.isnan(ww) else ww  # no depth was measured
        for a in range(6):
            gx, gy, gw = gains[k, a, 0], gains[k, a, 1], gains[k, a, 2]
            out[k, a, 0], out[k, a, 1], out[k, a, 2] = gx * xx + gy * xy, gx * xy + gy * yy, gw * ww
    return out


@compiled
def _added_up(moved: Array, here: Index, gains: Array, there: Index) -> Array:
    """Return the sum (6 x 6) of `moved[here] gains[there]'` over m features (`moved`, `gains`: of n x 6 x 3)."""
    out = np.zeros((6, 6))
    for k in range(len(here)):
        i, j = here[k], there[k]
        for a in range(6):
            for b in range(6):
                out[a, b] += (
                    moved[i, a, 0] * gains[j, b, 0] + moved[i, a, 1] * gains[j, b, 1] + moved[i, a, 2] * gains[j, b, 2]
                )
    return out


def gains_of(
    fit: PoseFit, covariance: Array, points: Array, covariances: Array, source: Measurements, target: Measurements,
    used: Mask,
) -> tuple[Array, Array]:  # fmt: skip
    """Return what errors of the n values of source and of target do to a fit (n x 6 x 3 each, left perturbation).

    The fit, of 6 x 6 `covariance`, is that of the source's n `points` (with `covariances`) to the target's images;
    pairs that are not `used` move nothing.
    """
    return _gains(
        fit.T_camera_map, covariance, points, covariances, source.values, target.values, target.covariance, used,
        float(TUNING.cauchy_chi2),
    )  # fmt: skip


@compiled
def _gains(
    T: Array, covariance: Array, points: Array, covariances: Array, source: Array, values: Array, variances: Array,
    used: Mask, cauchy: float,
) -> tuple[Array, Array]:  # fmt: skip
    """Return -A P D and A for each pair: `A = inv(H) J' inv(S)`, `P D` is d(values of target) / d(values of source)."""
    n = len(points)
    of_source, of_target = np.zeros((n, 6, 3)), np.zeros((n, 6, 3))
    J, PD = np.zeros((3, 6)), np.zeros((3, 3))
    for k in range(n):
        x, y, w = projected(T, points, k)
        if not used[k] or w == 0.0:
            continue
        ray, depth, ixx, ixy, iyy, iww = robust_information(T, (x, y, w), covariances, values, variances, k, cauchy)
        # a pair of weight v counts as one of variance S / v: its errors are larger by the root of 1 / v
        of_ray, of_depth = np.sqrt(1.0 + ray / cauchy), np.sqrt(1.0 + depth / cauchy)
        interaction_matrix(x, y, w, J)
        u, v, z = source[k, 0], source[k, 1], 1.0 / source[k, 2]
        for c in range(3):
            column = (z * T[c, 0], z * T[c, 1], -z * z * (u * T[c, 0] + v * T[c, 1] + T[c, 2]))
            for j in range(3):
                PD[c, j] = column[j]
        for j in range(3):
            moved_z = PD[2, j]
            PD[0, j], PD[1, j], PD[2, j] = w * (PD[0, j] - x * moved_z), w * (PD[1, j] - y * moved_z), -w * w * moved_z
        for a in range(6):
            j0 = j1 = j2 = 0.0
            for b in range(6):
                j0 += covariance[a, b] * J[0, b]
                j1 += covariance[a, b] * J[1, b]
                j2 += covariance[a, b] * J[2, b]
            g = ((j0 * ixx + j1 * ixy) * of_ray, (j0 * ixy + j1 * iyy) * of_ray, j2 * iww * of_depth)
            for j in range(3):
                of_target[k, a, j] = g[j]
                of_source[k, a, j] = -(g[0] * PD[0, j] + g[1] * PD[1, j] + g[2] * PD[2, j])
    return of_source, of_target
