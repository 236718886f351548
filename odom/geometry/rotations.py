"""Rotations, many at once: matrices (n x 3 x 3), unit quaternions (n x 4: x, y, z, w), rotation vectors (n x 3, rad).

scipy's Rotation does the same, but importing it takes .2 s, for which the end of every run and each viewer would wait.
Formulas: J. Sola et al., "A micro Lie theory for state estimation in robotics", 2018, appendix B.
"""

import numpy as np

from odom.geometry.arrays import Array

_SMALL = 1e-6
"""Half of an angle (rad), or an angle, below which the first terms of a series are exact to rounding."""


def quaternions_of(R: Array) -> Array:
    """Return the unit quaternions (n x 4, w not negative) of rotation matrices.

    Of four rows that are q q^T but for a factor, the one with the largest diagonal element (S. W. Shepperd, 1978).
    """
    (a, b, c), (d, e, f), (g, h, i) = (tuple(row) for row in R.transpose(1, 2, 0))
    products = np.array(
        [
            [1 + a - e - i, b + d, c + g, h - f],
            [b + d, 1 - a + e - i, f + h, c - g],
            [c + g, f + h, 1 - a - e + i, d - b],
            [h - f, c - g, d - b, 1 + a + e + i],
        ]
    )
    largest = np.argmax(np.diagonal(products), axis=1)
    rows = products[largest, :, np.arange(len(R))]
    return np.asarray(rows / np.copysign(np.linalg.norm(rows, axis=1), rows[:, 3])[:, None])


def matrices_of(quaternions: Array) -> Array:
    """Return the rotation matrices of quaternions (n x 4), whose length does not matter."""
    x, y, z, w = (quaternions / np.linalg.norm(quaternions, axis=1)[:, None]).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.asarray(np.array(rows).transpose(2, 0, 1))


def vectors_of(R: Array) -> Array:
    """Return the rotation vectors (n x 3, rad, at most pi long) of rotation matrices."""
    q = quaternions_of(R)
    sine = np.linalg.norm(q[:, :3], axis=1)
    half = np.arctan2(sine, q[:, 3])
    return np.asarray(q[:, :3] * np.where(sine < _SMALL, 2.0, 2.0 * half / np.maximum(sine, _SMALL))[:, None])


def matrices_of_vectors(vectors: Array) -> Array:
    """Return the rotation matrices of rotation vectors (n x 3, rad)."""
    half = 0.5 * np.linalg.norm(vectors, axis=1)
    share = np.where(half < _SMALL, 0.5, 0.5 * np.sin(half) / np.maximum(half, _SMALL))
    return matrices_of(np.column_stack([vectors * share[:, None], np.cos(half)]))


def angles_of(R: Array) -> Array:
    """Return the angles (n, rad) of rotation matrices."""
    q = quaternions_of(R)
    return np.asarray(2.0 * np.arctan2(np.linalg.norm(q[:, :3], axis=1), q[:, 3]))


def mean_of(R: Array) -> Array:
    """Return the mean (3 x 3) of rotation matrices: the quaternion that is least turned against theirs.

    Source: F. L. Markley et al., "Averaging quaternions", Journal of Guidance, Control, and Dynamics 30, 2007.
    """
    q = quaternions_of(R)
    return np.asarray(matrices_of(np.linalg.eigh(q.T @ q)[1][:, -1:].T)[0])


def turn_onto(vectors: Array, onto: Array) -> Array:
    """Return the rotation (3 x 3), never a reflection, that brings `vectors` (n x 3) onto `onto` (n x 3) best.

    Best by least squares: W. Kabsch, 1976. Pairs are weighted by the product of their lengths.
    """
    U, _, Vt = np.linalg.svd(vectors.T @ onto)
    return np.asarray(Vt.T @ np.diag([1.0, 1.0, np.linalg.det(Vt.T @ U.T)]) @ U.T)
