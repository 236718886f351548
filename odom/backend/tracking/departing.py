"""Landmarks that begin to move: they and their neighbours in space used to be found, and now contradict the pose."""

import numpy as np

from odom.backend.tracking.tuning import TUNING
from odom.geometry.arrays import Array, Mask
from odom.geometry.neighbours import nearest


def departing(points: Array, eye: Array, found_before: Array, agrees: Mask) -> Mask:
    """Return which of n landmarks at `points` (n x 3, m) lie on something that begins to move.

    `eye` (3, m) is the camera's centre, `found_before` (n) the share of frames in which each was found so far, `agrees`
    (n) whether it lies where the pose puts it. Landmarks on a body that sets off are returned even if they happen to
    agree: they are near, and would pull the pose along. One that was hardly ever found proves nothing by disagreeing,
    and where landmarks are sparse their neighbours lie on other things.
    """
    if len(points) <= TUNING.departing_neighbours:
        return np.zeros(len(points), dtype=np.bool_)
    near, within_m2 = nearest(points, points, TUNING.departing_neighbours)
    is_one_thing = within_m2 < (TUNING.departing_within * np.linalg.norm(points - eye, axis=1)) ** 2
    return np.asarray(is_one_thing & ((found_before - agrees)[near].mean(axis=1) > TUNING.departing_share))
