"""Forgetting key frames, so that the map is bounded: the oldest that are not needed now give up all they measured.

What stays of a forgotten key frame is its pose, parent and covariances, some 2 KB: frames that were placed by it, and
chains of covariances through it, still need them. That has no bound of its own; eight hours of nothing but new places,
a key frame every half second, come to 100 MB, as much as the frames' own places.

A forgotten key frame moves rigidly with its heir: of the key frames that it was registered with, the nearest one. Where
the camera went ever onwards that is the oldest one remembered, which adjustments hold, so the past stays; where it kept
coming back the past is corrected with what is there now. Nobody moves the last one of a segment any more.
"""

import numpy as np
from numpy.typing import NDArray

from odom.backend.keyframes import Keyframe
from odom.backend.map import Map
from odom.backend.tree import turn_round
from odom.registration import se3

Index = NDArray[np.int64]


def oldest_beyond(map_: Map, most: int, needed: Index) -> list[int]:
    """Return the key frames to forget for `most` to remain, oldest first, without those `needed`."""
    surplus = max(0, len(map_.remembered) - most)
    return [n for n in map_.remembered if n not in needed][:surplus]


def forget(map_: Map, number: int) -> None:
    """Forget a key frame: its landmarks are given up, its registrations handed to its heir, which it follows from now.

    A chain of registrations stays as sure as it was; where it branched at the key frame, the branches become less sure
    of each other by what lies between key frame and heir, never surer.
    """
    keyframe, landmarks = map_.keyframes[number], map_.landmarks
    landmarks.cull(np.flatnonzero(landmarks.alive & (landmarks.keyframe == number)))
    keyframe.forget()
    map_.remembered.remove(number)
    children = [map_.keyframes[n] for n in map_.remembered if map_.keyframes[n].parent == number]
    heir = _heir(map_, keyframe, children)
    for other in map_.links[number]:
        map_.links[other].discard(number)
    map_.links[number] = set()
    followers = map_.followers.pop(number, [])
    if heir is None:
        return
    map_.followers.setdefault(heir.number, []).extend([*followers, number])
    if heir.parent == number:
        turn_round(keyframe, heir)
        children.remove(heir)
        if heir.parent is not None:
            map_.link(heir.number, heir.parent)
    for child in children:
        T_keyframe_child = keyframe.T_camera_map @ se3.inverse(child.T_camera_map)
        child.covariance_parent = se3.compose_covariance(
            keyframe.covariance_parent, T_keyframe_child, child.covariance_parent
        )
        child.parent = heir.number
        map_.link(heir.number, child.number)


def _heir(map_: Map, keyframe: Keyframe, children: list[Keyframe]) -> Keyframe | None:
    """Return the nearest key frame registered with this one; without any, one of its segment; None without those."""
    registered = [k.number for k in children]
    registered += [] if keyframe.parent is None else [keyframe.parent]
    near = registered or [n for n in map_.remembered if map_.keyframes[n].segment == keyframe.segment]
    return map_.keyframes[int(map_.nearest(near, keyframe.T_camera_map)[0])] if near else None
