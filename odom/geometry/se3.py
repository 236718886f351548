"""Rigid motions as 4 x 4 matrices `T_target_source` (metres), and their tangent space.

A tangent vector is `xi = (rho, phi)`: translation first (metres), rotation last (radians), the order of ROS.
A 6 x 6 covariance of `T_target_source` describes `xi` in `T_true = T_estimate @ exp(xi)`, so it is expressed in
the SOURCE frame. Formulas: J. Sola et al., "A micro Lie theory for state estimation in robotics", 2018,
appendices B (SO(3)) and D (SE(3)).
"""

import math

import numpy as np

from odom.geometry.arrays import Array

_I3, _I4 = np.eye(3), np.eye(4)
_SMALL = 1e-5
"""rad; below it series to the second order are exact to rounding, where quotients of sines lose digits."""
_NEAR_A_HALF_TURN = -0.9
"""Cosine of the angle (154 degrees) from which on the axis is read from the symmetric part of the rotation."""


def hat(phi: Array) -> Array:
    """Return the 3 x 3 matrix with `hat(phi) @ v == cross(phi, v)`."""
    x, y, z = phi.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def so3_exp(phi: Array) -> Array:
    """Return the rotation matrix of the rotation vector `phi` (3, radians): Rodrigues' formula."""
    theta = math.sqrt(phi @ phi)
    W = hat(phi)
    if theta < _SMALL:
        return np.asarray(_I3 + W + 0.5 * W @ W)
    return np.asarray(_I3 + np.sin(theta) / theta * W + (1.0 - np.cos(theta)) / theta**2 * W @ W)


def so3_log(R: Array) -> Array:
    """Return the rotation vector (3, radians, norm at most pi) of the rotation matrix `R`."""
    twice_sine = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine, cosine = 0.5 * math.sqrt(twice_sine @ twice_sine), 0.5 * float(R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    if cosine > _NEAR_A_HALF_TURN:
        return np.asarray(twice_sine * (0.5 if sine < _SMALL else 0.5 * np.arctan2(sine, cosine) / sine))
    k = int(np.argmax(np.diagonal(R)))
    axis = 0.5 * (R[:, k] + R[k])  # of cos I + (1 - cos) a a', the symmetric part: the sine is near 0 here
    axis[k] -= cosine
    axis *= np.arctan2(sine, cosine) / np.sqrt(axis @ axis)
    return np.asarray(-axis if axis @ twice_sine < 0.0 else axis)


def left_jacobian(phi: Array) -> Array:
    """Return the 3 x 3 left Jacobian of SO(3) at `phi`: `exp((rho, phi))` has translation `J rho`."""
    theta = math.sqrt(phi @ phi)
    W = hat(phi)
    if theta < _SMALL:
        return np.asarray(_I3 + 0.5 * W + W @ W / 6.0)
    a = (1.0 - np.cos(theta)) / theta**2
    b = (theta - np.sin(theta)) / theta**3
    return np.asarray(_I3 + a * W + b * W @ W)


def exp(xi: Array) -> Array:
    """Return the 4 x 4 rigid motion of the tangent vector `xi` = (rho, phi)."""
    T = _I4.copy()
    T[:3, :3] = so3_exp(xi[3:])
    T[:3, 3] = left_jacobian(xi[3:]) @ xi[:3]
    return T


def log(T: Array) -> Array:
    """Return the tangent vector (rho, phi) of the rigid motion `T`."""
    phi = so3_log(T[:3, :3])
    return np.concatenate([np.linalg.solve(left_jacobian(phi), T[:3, 3]), phi])


def inverse(T: Array) -> Array:
    """Return the inverse of the rigid motion `T`."""
    out = _I4.copy()
    out[:3, :3] = T[:3, :3].T
    out[:3, 3] = -T[:3, :3].T @ T[:3, 3]
    return out


def orthonormal(T: Array) -> Array:
    """Return `T` with its rotation, drifted by rounding, brought back onto SO(3) (one Newton step)."""
    R = T[:3, :3]
    out = T.copy()
    out[:3, :3] = 0.5 * R @ (3.0 * _I3 - R.T @ R)
    return out


def adjoint(T: Array) -> Array:
    """Return the 6 x 6 matrix with `T @ exp(xi) == exp(adjoint(T) @ xi) @ T`."""
    R, t = T[:3, :3], T[:3, 3]
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = R
    out[:3, 3:] = hat(t) @ R
    return out


def apply(T: Array, points_source: Array) -> Array:
    """Return the n x 3 points mapped into the target frame."""
    return np.asarray(points_source @ T[:3, :3].T + T[:3, 3])


def compose_covariance(covariance_ab: Array, T_b_c: Array, covariance_bc: Array) -> Array:
    """Return the covariance of `T_a_b @ T_b_c` for independent errors of the two, to first order."""
    A = adjoint(inverse(T_b_c))
    return np.asarray(A @ covariance_ab @ A.T + covariance_bc)


def inverse_covariance(T_a_b: Array, covariance_ab: Array) -> Array:
    """Return the covariance of `inverse(T_a_b)`, expressed in frame a."""
    A = adjoint(T_a_b)
    return np.asarray(A @ covariance_ab @ A.T)
