"""Along which axes a body's turns show where the camera sits in it, its lever arm.

The camera's position moves by `R_k t` as the body turns, so that the part of `t` along an axis is seen by the turns
across that axis alone. Where the body turns about one axis only (a robot on a floor, a turntable), these are the noise
of motion capture, and a fit to them is metres wrong.
"""

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.rotations import vectors_of

_CLEAR = 2.0
"""Ratio of the turns across an axis to the errors of rotation from which on they are turns: noise alone comes to 1; a
smaller ratio takes noise for turns, a larger one leaves out what a floor that is not even shows."""


def settled_axes(R_world_body: Array, errors: Array) -> Array:
    """Return the projection (3 x 3, in the body's frame) on the axes along which turns show the lever arm.

    `R_world_body` are n successive rotations of the body, `errors` (n x 3, rad) those of rotation found, in its frame;
    what counts is by how much both change from one to the next (RMS).
    """
    turns = vectors_of(R_world_body[:-1].transpose(0, 2, 1) @ R_world_body[1:])
    turned, erred = _across(turns), _across(np.diff(errors, axis=0))
    _, axes = np.linalg.eigh(turned)
    clear = np.array([axis @ turned @ axis > _CLEAR**2 * (axis @ erred @ axis) for axis in axes.T])
    return np.asarray((axes * clear) @ axes.T)


def _across(turns: Array) -> Array:
    """Return the matrix M (3 x 3) of which a' M a is the mean square of n turns (n x 3) across a unit axis a."""
    moments = turns.T @ turns / len(turns)
    return np.asarray(np.trace(moments) * np.eye(3) - moments)
