"""The tree of registrations: which key frame was registered against which, and how sure one is of another by it."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from odom.backend.keyframes import Keyframe
from odom.registration import se3

Array = NDArray[np.float64]

_LONGEST_PATH = 200


def _ancestors(keyframes: Sequence[Keyframe], number: int, most: int) -> list[int]:
    path = [number]
    while len(path) < most and (parent := keyframes[path[-1]].parent) is not None:
        path.append(parent)
    return path


def covariance_between(keyframes: Sequence[Keyframe], a: int, b: int) -> Array:
    """Return the 6 x 6 covariance (`se3`, frame b) of T_a_b: the sum over the registrations on the path from a to b."""
    up_a, up_b = (_ancestors(keyframes, number, _LONGEST_PATH) for number in (a, b))
    above_b = set(up_b)
    common = next((k for k in up_a if k in above_b), None)
    total = np.zeros((6, 6))
    for path in (up_a, up_b):
        for k in path[: path.index(common) if common is not None else None]:
            A = se3.adjoint(keyframes[b].T_camera_map @ se3.inverse(keyframes[k].T_camera_map))
            total += A @ keyframes[k].covariance_parent @ A.T
    return total


def turn_round(parent: Keyframe, child: Keyframe) -> None:
    """Let the `child` be the parent of its `parent`, and have that one's own."""
    T_parent_child = parent.T_camera_map @ se3.inverse(child.T_camera_map)
    covariance_back = se3.inverse_covariance(T_parent_child, child.covariance_parent)
    child.covariance_parent = (
        parent.covariance_parent
        if parent.parent is None
        else se3.compose_covariance(parent.covariance_parent, T_parent_child, child.covariance_parent)
    )
    child.parent = parent.parent
    parent.parent, parent.covariance_parent = child.number, covariance_back


def graft(keyframes: Sequence[Keyframe], number: int, parent: int, covariance: Array) -> None:
    """Join the tree of key frame `number` to that of `parent`, against which it was registered with `covariance`.

    Within both trees everything stays as sure as it was.
    """
    path = _ancestors(keyframes, number, len(keyframes))
    for above, below in pairwise(reversed(path)):
        turn_round(keyframes[above], keyframes[below])
    keyframes[number].parent, keyframes[number].covariance_parent = parent, covariance
