"""The motion between two depth images by their surfaces alone: iterated closest points, from point to plane.

Source: Y. Chen and G. Medioni, "Object modelling by registration of multiple range images", 1992; points find their
planes by projection (G. Blais and M. Levine, 1995). Distances are measured as differences of inverse depth, whose noise
is that of the sensor, and which hardly depends on how far away a surface is.
"""

import math
from dataclasses import dataclass

import numpy as np

from odom.frontend.camera.lens import ahead, pixel_of
from odom.frontend.features.surface import Surfaces
from odom.frontend.matching.tuning import TUNING
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled

_CONVERGED = 1e-4
"""m and rad; a smaller step ends the search."""
_GATES = TUNING.surface_gate_sigmas, TUNING.surface_huber_sigmas, TUNING.surface_shared_noise
"""What `_normal_equations` is told beside the share of the inverse depth, which shrinks."""
_UNKNOWN_M = 1.0
"""One sigma of the motion in a direction of which surfaces say nothing."""


@dataclass(frozen=True, eq=False)
class SurfaceAlignment:
    """The motion `T_target_source` that brings the surfaces of one view onto those of another, and its `covariance`.

    The covariance is 6 x 6 (`se3`, source frame). `has_shape`: the surfaces hold the camera in all directions and about
    all axes; along a single wall it can slide. `overlap` is the share of the source's points that agree with planes of
    the target, and `misfit` the mean square of their distances in sigmas: 1 where nothing but noise keeps them apart.
    `in_front` is the share of the source's points that lie clearly before planes of the target, where it saw nothing.
    """

    T_target_source: Array
    covariance: Array
    has_shape: bool
    overlap: float
    misfit: float
    in_front: float


def align_surfaces(source: Surfaces, target: Surfaces, T_target_source: Array, covariance: Array) -> SurfaceAlignment:
    """Return the alignment of `source` with `target`, given the motion expected, `T_target_source`.

    Its `covariance` (6 x 6, `se3`, source frame) keeps points from sliding along surfaces while they look for theirs
    (an iterated extended Kalman filter's update: B. Bell and F. Cathey, 1993). What is returned is what the surfaces
    say by themselves; in directions in which they have no shape, the motion is left as expected.
    """
    known = source.rays[..., 2] > 0.0
    rays, variance = source.rays[known], source.variance[known]
    if not len(rays):
        return SurfaceAlignment(T_target_source, _UNKNOWN_M**2 * np.eye(6), False, 0.0, 0.0, 0.0)
    points = np.column_stack([rays[:, :2], np.ones(len(rays))]) / rays[:, 2:]
    lens, gate = target.lens, TUNING.surface_gate_share
    cell_v, cell_u = (side / cells for side, cells in zip(lens.rays.shape[:2], target.planes.shape[:2], strict=True))
    image = lens.intrinsics, lens.projection, cell_u, cell_v
    expected, T = np.asarray(np.linalg.inv(covariance)), T_target_source
    for _ in range(TUNING.surface_iterations):
        gates = gate, *_GATES
        H, S, g, chi2, agreeing, before = _normal_equations(
            points, variance, target.planes, target.variance, T, image, gates
        )
        away = se3.log(se3.inverse(T) @ T_target_source)
        step = np.asarray(np.linalg.solve(H + expected, g + expected @ away))
        if gate == TUNING.surface_least_gate_share and np.linalg.norm(step) < _CONVERGED:
            break
        T = T @ se3.exp(step)
        gate = max(gate * TUNING.surface_gate_shrinks, TUNING.surface_least_gate_share)
    # directions in which a step leads away from the surfaces; a rotation counts by how far it moves the usual point
    unit = np.repeat([1.0, 1.0 / float(np.linalg.norm(points, axis=1).mean())], 3)
    share, axes = np.linalg.eigh(unit[:, None] * S * unit / max(agreeing, 1))
    is_held = share >= TUNING.surface_least_shape
    V, W = unit[:, None] * axes[:, is_held], _UNKNOWN_M * unit[:, None] * axes[:, ~is_held]
    C = np.asarray(V @ np.linalg.inv(V.T @ H @ V) @ V.T)
    T_found = se3.orthonormal(T @ se3.exp(C @ g))
    overlap, misfit = agreeing / len(points), chi2 / max(agreeing, 1)
    return SurfaceAlignment(T_found, C + W @ W.T, bool(is_held.all()), overlap, misfit, before / len(points))


def warm_up() -> None:
    """Compile or load what is needed as soon as colour shows nothing, before the first frame."""
    image = np.ones(4), np.zeros(18), 1.0, 1.0
    _normal_equations(
        np.zeros((1, 3)), np.ones(1), np.ones((1, 1, 3)), np.ones((1, 1)), np.eye(4), image, (0.1, *_GATES)
    )


@compiled
def _normal_equations(
    points: Array,
    variance: Array,
    planes: Array,
    plane_variance: Array,
    T: Array,
    image: tuple[Array, Array, float, float],
    gates: tuple[float, float, float, float],
) -> tuple[Array, Array, Array, float, int, int]:
    """Return both sides `H` (6 x 6) and `g` of the normal equations at `T` (T_target_source), with four more values.

    Those are the sum `S` (6 x 6) of the outer products of J / |m|, the sum of the squared distances in sigmas, how many
    points agree with their planes, and how many lie before them by more than two gates. A point q = T p on the ray
    (x, y, 1) before the plane m has the residual r = 1 / z - m (x, y, 1). It changes by -J xi / z with T exp(xi): J is
    (R' m, p x R' m), as only the step of q counts, not the ray on which it comes to lie.
    """
    intrinsics, projection, cell_u, cell_v = image
    share, sigmas, huber, shared = gates
    rows, columns = planes.shape[0], planes.shape[1]
    H, S, g, J = np.zeros((6, 6)), np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    chi2, agreeing, before = 0.0, 0, 0
    for k in range(len(points)):
        x, y, z = ahead(T, points, k)
        if z == 0.0:
            continue
        u, v = pixel_of(x, y, intrinsics, projection)
        if not (u >= -0.5 and v >= -0.5):
            continue
        column, row = int((u + 0.5) / cell_u), int((v + 0.5) / cell_v)
        if column >= columns or row >= rows:
            continue
        m = planes[row, column]
        r = 1.0 / z - (m[0] * x + m[1] * y + m[2])
        sigma = math.sqrt(variance[k] + plane_variance[row, column])
        gate = share / z + sigmas * sigma
        if not abs(r) < gate:  # nor where there is no plane
            before += r > 2.0 * gate
            continue
        chi2, agreeing = chi2 + (r / sigma) ** 2, agreeing + 1
        a = T[0, 0] * m[0] + T[1, 0] * m[1] + T[2, 0] * m[2]
        b = T[0, 1] * m[0] + T[1, 1] * m[1] + T[2, 1] * m[2]
        c = T[0, 2] * m[0] + T[1, 2] * m[1] + T[2, 2] * m[2]
        J[0], J[1], J[2] = a, b, c
        J[3] = points[k, 1] * c - points[k, 2] * b
        J[4] = points[k, 2] * a - points[k, 0] * c
        J[5] = points[k, 0] * b - points[k, 1] * a
        weight = min(1.0, huber * sigma / abs(r)) / (z * z * sigma * sigma)
        for i in range(6):
            g[i] += weight * J[i] * r * z
            for j in range(6):
                H[i, j] += weight * J[i] * J[j]
                S[i, j] += J[i] * J[j] / (a * a + b * b + c * c)
    return H / shared, S, g / shared, chi2, agreeing, before
