"""3-sigma ellipsoids of key frame positions, few enough not to hide the trajectory."""

from collections.abc import Iterator, Sequence

import numpy as np
import rerun as rr

from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.geometry.rotations import quaternions_of
from odom.viewer import entities, palette
from odom.viewer.entities import EntityUpdate, update
from odom.wire.codec import StampedPose

_MOST = 150
"""Ellipsoids drawn at most, evenly chosen: more slow a browser down."""
_CLEARANCE = 6.0
"""Standard deviations between two that are drawn: two that are as large then just touch."""


def ellipsoids(stamp: Stamp, poses: Sequence[StampedPose], covariances: Sequence[Array]) -> Iterator[EntityUpdate]:
    """Yield the ellipsoids of n key frames (covariances 6 x 6, in their own frames), nothing for none.

    On a short way they are larger than the way is long: then only those are drawn that stand apart.
    """
    if not poses:
        return
    even = slice(None, None, max(1, -(-len(poses) // _MOST)))
    centres = np.array([pose.T_parent_child[:3, 3] for pose in poses])[even]
    blocks = np.array([covariance[:3, :3] for covariance in covariances])[even]
    rotations = np.array([pose.T_parent_child[:3, :3] for pose in poses])[even]
    variances, axes = np.linalg.eigh(blocks)
    apart = standing_apart(centres, _CLEARANCE * np.sqrt(np.maximum(variances[:, -1], 0.0)))
    axes[np.linalg.det(axes) < 0, :, 0] *= -1.0
    yield update(
        entities.COVARIANCE,
        stamp,
        rr.Ellipsoids3D(
            centers=centres[apart],
            half_sizes=3.0 * np.sqrt(np.maximum(variances[apart], 1e-12)),
            quaternions=quaternions_of((rotations @ axes)[apart]),
            colors=palette.ELLIPSOID,
            line_radii=-0.6,
            fill_mode=rr.components.FillMode.DenseWireframe,
        ),
    )


def standing_apart(centres: Array, clearances: Array) -> list[int]:
    """Return which of n centres (n x 3, m) to draw, in order.

    The newest, and back from it each that is clear of the one drawn before by its own clearance (n, m).
    """
    chosen = [len(centres) - 1]
    for i in range(len(centres) - 2, -1, -1):
        if np.linalg.norm(centres[i] - centres[chosen[-1]]) >= clearances[i]:
            chosen.append(i)
    return chosen[::-1]
