"""Alignment of an estimate with truth by positions and orientations, each weighted by what is known of its error.

Maximum likelihood over SE(3) for independent errors: Gauss-Newton on `e = log(inv(T E) Q)` of n poses, E estimated and
Q true, T the unknown. Its Jacobian is the adjoint of inv(E), whatever T is (J. Sola et al., "A micro Lie theory for
state estimation in robotics", 2018). While the camera hardly moves, positions alone do not tell how the two worlds are
turned against each other; orientations do.
"""

from dataclasses import dataclass

import numpy as np

from odom.errors import InputError
from odom.evaluation.alignment import align
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.geometry.rotations import mean_of, vectors_of

_ITERATIONS, _CONVERGED = 50, 1e-10
"""Gauss-Newton steps at most (some five are needed), ended by a smaller step (m, rad)."""
_UNDETERMINED = 1e-10
"""Smallest over largest eigenvalue of the scaled information, below which a direction is rounding, not measured."""
_LEARNINGS = 5
"""Rounds of learning the errors' size from the errors; nothing changes after three."""
_LEAST_M, _LEAST_RAD = 1e-6, 1e-6
"""Floor of a learnt standard deviation: an estimate that equals its truth has no errors to learn from."""


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """What is known of the errors of n pairs of poses; covariances in the camera's frame (`geometry.se3`), SI units.

    `independent` (n x 6 x 6): new at each pose, as the noise of motion capture. An infinite variance means that nothing
    is known along that axis. `shared` (n x 6 x 6): correlated over all poses, as an odometry's drift since it began; it
    is treated as one error, scaled at each pose to that covariance. `hand_eye` (6 x 6): of the camera in the body whose
    truth it is, one error for all poses, fixed to the camera.
    """

    independent: Array
    shared: Array | None = None
    hand_eye: Array | None = None


@dataclass(frozen=True, eq=False)
class PoseAlignment:
    """The alignment `T_truth_estimate`, its 6 x 6 `covariance` (`geometry.se3`: in the estimate's world)."""

    T_truth_estimate: Array
    covariance: Array

    @property
    def sigma_rad(self) -> float:
        """Standard deviation of the rotation about its worst axis."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[3:, 3:])[-1]))

    def at(self, T_estimate: Array) -> Array:
        """Return the alignment's 6 x 6 covariance as it shows at an estimated pose (4 x 4), in that pose's frame."""
        A = se3.adjoint(se3.inverse(T_estimate))
        return np.asarray(A @ self.covariance @ A.T)


@dataclass(frozen=True)
class PoseFigures:
    """Errors after an alignment by poses (RMSE), and the worst standard deviations of that alignment at the poses."""

    rmse_m: float
    rmse_deg: float
    sigma_m: float
    sigma_deg: float


def align_poses(T_estimate: Array, T_truth: Array, errors: PoseErrors) -> PoseAlignment:
    """Return the most likely rigid motion from n estimated poses (n x 4 x 4) to the true ones, with its covariance.

    Poses that are surer count more. With infinite variances of the orientations and equal ones of the positions this
    is `align`. Raises InputError for fewer than three poses, unequal shapes, a covariance that is not positive
    definite, and where the poses do not determine the motion.
    """
    n = len(T_estimate)
    if T_estimate.shape != (n, 4, 4) or T_truth.shape != T_estimate.shape or errors.independent.shape != (n, 6, 6):
        raise InputError(f"cannot align {T_estimate.shape} with {T_truth.shape} poses: give n x 4 x 4 and n x 6 x 6")
    W = _information(errors.independent if errors.shared is None else errors.independent + errors.shared)
    A = np.array([se3.adjoint(T) for T in se3.inverses(T_estimate)]).reshape(n, 6, 6)
    AW = A.transpose(0, 2, 1) @ W
    H = (AW @ A).sum(axis=0)
    _check_determined(H)
    starts = (align(T_estimate[:, :3, 3], T_truth[:, :3, 3]).T_truth_estimate, _by_orientations(T_estimate, T_truth))
    T = min(
        (_refined(start, T_estimate, T_truth, AW, H) for start in starts),
        key=lambda T: _cost(T, T_estimate, T_truth, W),
    )
    covariance = np.linalg.inv(H)
    gain = covariance @ AW
    if errors.shared is not None:
        known = np.where(np.isfinite(errors.independent), errors.independent, 0.0)
        covariance = (gain @ known @ gain.transpose(0, 2, 1)).sum(axis=0)
        one = (gain @ _roots(errors.shared) @ _turned(T_estimate).transpose(0, 2, 1)).sum(axis=0)
        covariance += one @ one.T
    if errors.hand_eye is not None:
        of_hand_eye = gain.sum(axis=0)
        covariance = covariance + of_hand_eye @ errors.hand_eye @ of_hand_eye.T
    return PoseAlignment(T, covariance)


def align_poses_alike(T_estimate: Array, T_truth: Array, hand_eye: Array | None = None) -> PoseAlignment:
    """Return the alignment where no covariance is known: the size of the errors is learnt from the errors.

    One standard deviation for positions and one for orientations; all errors are treated as correlated, so the
    alignment is no surer than a single pose. Raises InputError like `align_poses`.
    """
    n, sigma = len(T_estimate), np.ones(2)
    for _ in range(_LEARNINGS):
        alike = np.tile(np.diag(np.repeat(np.square(sigma), 3)), (n, 1, 1))
        found = align_poses(T_estimate, T_truth, PoseErrors(np.zeros((n, 6, 6)), alike, hand_eye))
        e = pose_errors(found.T_truth_estimate, T_estimate, T_truth).reshape(n, 2, 3)
        sigma = np.maximum(np.sqrt(np.square(e).mean(axis=(0, 2))), (_LEAST_M, _LEAST_RAD))
    return found


def figures(found: PoseAlignment, T_estimate: Array, T_truth: Array) -> PoseFigures:
    """Return the figures of an alignment of n poses (n x 4 x 4) with the true ones."""
    e = np.square(pose_errors(found.T_truth_estimate, T_estimate, T_truth).reshape(-1, 2, 3)).sum(axis=2).mean(axis=0)
    covariances = np.array([found.at(T) for T in T_estimate])
    worst = [np.sqrt(np.linalg.eigvalsh(covariances[:, k, k])[:, -1].max()) for k in (slice(3), slice(3, 6))]
    return PoseFigures(
        float(np.sqrt(e[0])), float(np.degrees(np.sqrt(e[1]))), float(worst[0]), float(np.degrees(worst[1]))
    )


def pose_errors(T_truth_estimate: Array, T_estimate: Array, T_truth: Array) -> Array:
    """Return n x 6 errors (m, rad) of the aligned poses, each in its estimated camera frame."""
    step = se3.inverses(T_truth_estimate @ T_estimate) @ T_truth
    return np.column_stack([step[:, :3, 3], vectors_of(step[:, :3, :3])])


def _refined(T: Array, T_estimate: Array, T_truth: Array, AW: Array, H: Array) -> Array:
    for _ in range(_ITERATIONS):
        e = pose_errors(T, T_estimate, T_truth)
        step = np.linalg.solve(H, np.einsum("nij,nj->i", AW, e))
        T = se3.orthonormal(T @ se3.exp(step))
        if np.abs(step).max() < _CONVERGED:
            break
    return T


def _cost(T: Array, T_estimate: Array, T_truth: Array, W: Array) -> float:
    e = pose_errors(T, T_estimate, T_truth)
    return float(np.einsum("ni,nij,nj->", e, W, e))


def _by_orientations(T_estimate: Array, T_truth: Array) -> Array:
    """Return the alignment of the mean turn and the mean shift."""
    T = np.eye(4)
    turns = T_truth[:, :3, :3] @ T_estimate[:, :3, :3].transpose(0, 2, 1)
    T[:3, :3] = mean_of(turns)
    T[:3, 3] = (T_truth[:, :3, 3] - T_estimate[:, :3, 3] @ T[:3, :3].T).mean(axis=0)
    return T


def _information(covariances: Array) -> Array:
    """Return the inverses of n x 6 x 6 covariances, zero along the axes whose variance is infinite."""
    unknown = ~np.isfinite(np.diagonal(covariances, axis1=1, axis2=2))
    touched = unknown[:, :, None] | unknown[:, None, :]
    finite = np.where(touched, np.eye(6), covariances)
    try:
        np.linalg.cholesky(finite)
    except np.linalg.LinAlgError:
        raise InputError("a 6 x 6 covariance is not positive definite: leave that pose out of the alignment") from None
    return np.where(touched, 0.0, np.linalg.inv(finite))


def _check_determined(H: Array) -> None:
    scale = np.sqrt(np.maximum(np.diag(H), 1e-300))
    values = np.linalg.eigvalsh(H / np.outer(scale, scale))
    if values[0] < _UNDETERMINED * values[-1]:
        raise InputError("the poses do not determine how the two worlds lie: give orientations, or a path with turns")


def _roots(covariances: Array) -> Array:
    """Return the symmetric square roots of n x 6 x 6 covariances."""
    values, axes = np.linalg.eigh(covariances)
    return np.asarray((axes * np.sqrt(np.maximum(values, 0.0))[:, None, :]) @ axes.transpose(0, 2, 1))


def _turned(T: Array) -> Array:
    """Return n x 6 x 6 matrices that turn a tangent from the camera's axes into those of its world."""
    out = np.zeros((len(T), 6, 6))
    out[:, :3, :3] = out[:, 3:, 3:] = T[:, :3, :3]
    return out
