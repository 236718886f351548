"""Rigid motions as 4 x 4 matrices `T_target_source` (metres), and their tangent space.

A tangent vector is `xi = (rho, phi)`: translation first (metres), rotation last (radians), the order of ROS.
A 6 x 6 covariance of `T_target_source` describes `xi` in `T_true = T_estimate @ exp(xi)`, so it is expressed in
the SOURCE frame. Formulas: J. Sola et al., "A micro Lie theory for state estimation in robotics", 2018,
appendices B (SO(3)) and D (SE(3)).

What is called tens of times a frame is written out in numbers: numpy takes longer to look at so small arrays, and two
to three times as long to make one of nested lists as of a flat one.
"""

import math

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.rotations import vectors_of

_I3 = np.eye(3)
"""The rotation that turns nothing."""
_SMALL = 1e-5
"""rad; below it series to the second order are exact to rounding, where quotients of sines lose digits."""
_NEAR_A_HALF_TURN = -0.9
"""Cosine of the angle (154 degrees) from which on the axis is read from the symmetric part of the rotation."""


def hat(phi: Array) -> Array:
    """Return the 3 x 3 matrix with `hat(phi) @ v == cross(phi, v)`."""
    x, y, z = phi.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def hats(phi: Array) -> Array:
    """Return the `hat` (n x 3 x 3) of each of n vectors (n x 3)."""
    out, (x, y, z) = np.zeros((len(phi), 3, 3)), phi.T
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -z, y, -x
    out[:, 1, 0], out[:, 2, 0], out[:, 2, 1] = z, -y, x
    return out


def so3_exp(phi: Array) -> Array:
    """Return the rotation matrix of the rotation vector `phi` (3, radians): Rodrigues' formula."""
    theta = math.sqrt(phi @ phi)
    W = hat(phi)
    if theta < _SMALL:
        return np.asarray(_I3 + W + 0.5 * W @ W)
    return np.asarray(_I3 + np.sin(theta) / theta * W + (1.0 - np.cos(theta)) / theta**2 * W @ W)


def so3_log(R: Array) -> Array:
    """Return the rotation vector (3, radians, norm at most pi) of the rotation matrix `R`."""
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    x, y, z = h - f, c - g, d - b  # the axis times twice the sine
    sine, cosine = 0.5 * math.sqrt(x * x + y * y + z * z), 0.5 * (a + e + i - 1.0)
    if cosine > _NEAR_A_HALF_TURN:
        scale = 0.5 if sine < _SMALL else 0.5 * math.atan2(sine, cosine) / sine
        return np.array([scale * x, scale * y, scale * z])
    k = int(np.argmax(np.diagonal(R)))
    axis = 0.5 * (R[:, k] + R[k])  # of cos I + (1 - cos) a a', the symmetric part: the sine is near 0 here
    axis[k] -= cosine
    axis *= np.arctan2(sine, cosine) / np.sqrt(axis @ axis)
    return np.asarray(-axis if axis @ np.array([x, y, z]) < 0.0 else axis)


def exp(xi: Array) -> Array:
    """Return the 4 x 4 rigid motion of the tangent vector `xi` = (rho, phi)."""
    r, s, t, x, y, z = xi.tolist()
    theta2 = x * x + y * y + z * z
    theta = math.sqrt(theta2)
    if theta < _SMALL:
        a, b, c = 1.0, 0.5, 1.0 / 6.0
    else:
        a, b = math.sin(theta) / theta, (1.0 - math.cos(theta)) / theta2
        c = (1.0 - a) / theta2
    # with W = hat(phi), W^2 = phi phi' - theta^2 I: R = I + a W + b W^2 and the translation rho + b W rho + c W^2 rho
    d = 1.0 - b * theta2
    xy, xz, yz = b * x * y, b * x * z, b * y * z
    u, v, w = y * t - z * s, z * r - x * t, x * s - y * r
    return np.array([
        d + b * x * x, xy - a * z, xz + a * y, r + b * u + c * (y * w - z * v),
        xy + a * z, d + b * y * y, yz - a * x, s + b * v + c * (z * u - x * w),
        xz - a * y, yz + a * x, d + b * z * z, t + b * w + c * (x * v - y * u),
        0.0, 0.0, 0.0, 1.0,
    ]).reshape(4, 4)  # fmt: skip


def log(T: Array) -> Array:
    """Return the tangent vector (rho, phi) of the rigid motion `T`."""
    x, y, z = so3_log(T[:3, :3]).tolist()
    r, s, t = T[:3, 3].tolist()
    theta2 = x * x + y * y + z * z
    theta = math.sqrt(theta2)
    # the inverse of the left Jacobian: I - W / 2 + d W^2
    d = 1.0 / 12.0 if theta < _SMALL else (1.0 - 0.5 * theta / math.tan(0.5 * theta)) / theta2
    u, v, w = y * t - z * s, z * r - x * t, x * s - y * r
    return np.array(
        [
            r - 0.5 * u + d * (y * w - z * v),
            s - 0.5 * v + d * (z * u - x * w),
            t - 0.5 * w + d * (x * v - y * u),
            x,
            y,
            z,
        ]
    )


def logs(T: Array) -> Array:
    """Return the tangent vectors (n x 6) of n rigid motions, as `log` does."""
    phi, t = vectors_of(T[:, :3, :3]), T[:, :3, 3]
    theta2 = np.square(phi).sum(axis=1)
    half = 0.5 * np.sqrt(np.maximum(theta2, _SMALL**2))
    d = np.where(theta2 < _SMALL**2, 1.0 / 12.0, (1.0 - half / np.tan(half)) / (4.0 * half * half))
    turned = np.cross(phi, t)
    return np.column_stack([t - 0.5 * turned + d[:, None] * np.cross(phi, turned), phi])


def inverse(T: Array) -> Array:
    """Return the inverse of the rigid motion `T`."""
    (a, b, c, x), (d, e, f, y), (g, h, i, z), _ = T.tolist()
    return np.array([
        a, d, g, -(a * x + d * y + g * z),
        b, e, h, -(b * x + e * y + h * z),
        c, f, i, -(c * x + f * y + i * z),
        0.0, 0.0, 0.0, 1.0,
    ]).reshape(4, 4)  # fmt: skip


def inverses(T: Array) -> Array:
    """Return the inverses (n x 4 x 4) of n rigid motions."""
    out = np.zeros_like(T)
    R = T[:, :3, :3].transpose(0, 2, 1)
    out[:, :3, :3], out[:, 3, 3] = R, 1.0
    out[:, :3, 3] = -(R @ T[:, :3, 3, None])[:, :, 0]
    return out


def orthonormal(T: Array) -> Array:
    """Return `T` with its rotation, drifted by rounding, brought back onto SO(3) (one Newton step)."""
    R = T[:3, :3]
    out = T.copy()
    out[:3, :3] = 0.5 * R @ (3.0 * _I3 - R.T @ R)
    return out


def adjoint(T: Array) -> Array:
    """Return the 6 x 6 matrix with `T @ exp(xi) == exp(adjoint(T) @ xi) @ T`."""
    (a, b, c, x), (d, e, f, y), (g, h, i, z), _ = T.tolist()
    return np.array([
        a, b, c, y * g - z * d, y * h - z * e, y * i - z * f,
        d, e, f, z * a - x * g, z * b - x * h, z * c - x * i,
        g, h, i, x * d - y * a, x * e - y * b, x * f - y * c,
        0.0, 0.0, 0.0, a, b, c,
        0.0, 0.0, 0.0, d, e, f,
        0.0, 0.0, 0.0, g, h, i,
    ]).reshape(6, 6)  # fmt: skip


def adjoints(T: Array) -> Array:
    """Return the `adjoint` (n x 6 x 6) of each of n rigid motions."""
    out = np.zeros((len(T), 6, 6))
    R = T[:, :3, :3]
    out[:, :3, :3] = out[:, 3:, 3:] = R
    out[:, :3, 3:] = hats(T[:, :3, 3]) @ R
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
