"""Forgetting key frames, so that the map is bounded: the oldest that are not needed now give up all they measured.

What stays of a forgotten key frame is its pose and its registration with its heir, some 2 KB: frames that were placed
by it still need them. That has no bound of its own; eight hours of nothing but new places,
a key frame every half second, come to 100 MB, as much as the frames' own places.

A forgotten key frame moves rigidly with its heir: of the key frames that it was registered with, the nearest one. Where
the camera went ever onwards that is the oldest one remembered, which adjustments hold, so the past stays; where it kept
coming back the past is corrected with what is there now. Nobody moves the last one of a segment any more.
"""

from bisect import insort

import numpy as np
from numpy.typing import NDArray

from odom.backend.map import Map

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
    insort(map_.forgotten, number)
    for other in map_.links[number]:
        map_.links[other].discard(number)
    map_.links[number] = set()
    registered = [edge.b for edge in map_.registrations.of(number) if not edge.is_loop]
    near = registered or [n for n in map_.remembered if map_.keyframes[n].segment == keyframe.segment]
    followers = map_.followers.pop(number, [])
    if not near:
        return
    heir = int(map_.nearest(near, keyframe.T_camera_map)[0])
    map_.followers.setdefault(heir, []).extend([*followers, number])
    if registered:
        for other in map_.registrations.hand_over(number, heir):
            map_.link(heir, other)
