"""Landmarks that begin to move: they used to be found, and now they and their neighbours in space do not agree."""

import numpy as np

from odom.backend.tracking.tuning import TUNING
from odom.geometry.arrays import Array, Mask
from odom.geometry.neighbours import nearest


def departing(points: Array, eye: Array, found_before: Array, agrees: Mask) -> Mask:
    """Return which of n landmarks at `points` (n x 3, m) lie on something that begins to move.

    `eye` (3, m) is where they are seen from, `found_before` (n) the share of frames in which each was found so far,
    `agrees` (n) whether it lies where the pose puts it. Some on a body that sets off happen to agree: near as they are,
    they would draw the camera along. Landmarks that were hardly ever found surprise nobody when they are off, and
    where landmarks are sparse their neighbours are other things.
    """
    if len(points) <= TUNING.departing_neighbours:
        return np.zeros(len(points), dtype=np.bool_)
    near, within_m2 = nearest(points, points, TUNING.departing_neighbours)
    is_one_thing = within_m2 < (TUNING.departing_within * np.linalg.norm(points - eye, axis=1)) ** 2
    return np.asarray(is_one_thing & ((found_before - agrees)[near].mean(axis=1) > TUNING.departing_share))
