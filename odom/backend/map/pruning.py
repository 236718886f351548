"""Forgetting key frames, so that the map is bounded: the oldest that are not needed now lose all they measured.

What remains of a forgotten key frame is its pose and its registration with its heir, some 2 kB, since frames that were
placed by it still need them. These have no bound of their own: eight hours of nothing but new places, a key frame
every half second, come to 100 MB, as much as the log of all frames.

A forgotten key frame moves rigidly with its heir, the nearest of the key frames that it was registered with. Where the
camera always went on, that is the oldest one remembered, which adjustments hold, so the past stays as it is; where it
kept coming back, the past is corrected with what is there now. The last one that a segment has left is forgotten
without an heir: it and those that followed it stay where they are.
"""

from bisect import insort

import numpy as np

from odom.backend.map.map import Map
from odom.geometry.arrays import Index


def oldest_beyond(map_: Map, most: int, needed: Index) -> list[int]:
    """Return the key frames to forget so that `most` remain, oldest first, without those `needed`."""
    surplus = max(0, len(map_.remembered) - most)
    return [n for n in map_.remembered if n not in needed][:surplus]


def forget(map_: Map, number: int) -> None:
    """Forget a key frame: its landmarks are culled, its registrations go to its heir, which it follows from now on.

    A chain of registrations keeps its covariance; where it branched at the key frame, the covariance between branches
    grows by the registration of key frame and heir, and never shrinks.
    """
    keyframe, landmarks = map_.keyframes[number], map_.landmarks
    landmarks.cull(np.flatnonzero(landmarks.alive & (landmarks.keyframe == number)))
    keyframe.forget()
    map_.places.forget(number)
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
