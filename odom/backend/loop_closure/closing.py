"""What a confirmed registration does to the map: loops are closed, segments merged."""

from collections.abc import Sequence

import numpy as np

from odom.backend.map.map import Map
from odom.backend.map.pose_graph import Edge, optimise
from odom.geometry import se3

_NO_ROWS = np.zeros(0, dtype=np.int64)
"""No landmark was moved already: all move with their key frames."""


def close_loops(map_: Map, closures: Sequence[Edge]) -> None:
    """Move the key frames of a segment to where all registrations, the `closures` among them, agree best.

    The oldest one is held, or whatever of a map is fixed; forgotten ones follow.
    """
    for closure in closures:
        map_.register(closure)
    for segment in sorted({map_.keyframes[closure.b].segment for closure in closures}):
        members = _members(map_, segment)
        held = members[:1]
        if map_.is_fixed:
            free = [n for n in members if n >= map_.earlier]
            held = sorted({edge.b for n in free for edge in map_.registrations.of(n)}.difference(free))
            members = [*held, *free]
        T_map_keyframe = {n: se3.inverse(map_.keyframes[n].T_camera_map) for n in members}
        moved = optimise(T_map_keyframe, held, map_.registrations.among(T_map_keyframe.keys()))
        numbers = np.array(sorted(moved.keys() - held if map_.is_fixed else moved))
        map_.move_keyframes(numbers, np.array([se3.inverse(moved[int(n)]) for n in numbers]), _NO_ROWS)


def merge_segment(map_: Map, edge: Edge) -> None:
    """Move the whole segment of key frame `edge.b` into the map of `edge.a`'s segment, as the registration says.

    From then on its covariances since the start are those of that segment, by way of the registration. What earlier
    sessions made stays where it is: then the other segment moves.
    """
    if _is_earlier(map_, edge.b) and not _is_earlier(map_, edge.a):
        edge = edge.seen_from(edge.b)
    a, b = map_.keyframes[edge.a], map_.keyframes[edge.b]
    merged = [k for k in map_.keyframes if k.segment == b.segment]
    T_old_new = se3.inverse(b.T_camera_map) @ se3.inverse(edge.T_a_b) @ a.T_camera_map
    numbers = np.array(_members(map_, b.segment))
    T_camera_map = np.array([map_.keyframes[int(n)].T_camera_map @ T_old_new for n in numbers])
    map_.move_keyframes(numbers, T_camera_map, _NO_ROWS)
    map_.journal.move(k.number for k in merged)
    for k in merged:
        k.segment, k.first = a.segment, a.first
    map_.register(edge)
    reached, onward = {a.number}, [edge]
    while onward:
        step = onward.pop()
        if step.b not in reached:
            reached.add(step.b)
            onward += [e for e in map_.registrations.of(step.b) if not e.is_loop]
            map_.propagate_covariance(step)


def _members(map_: Map, segment: int) -> list[int]:
    """Return the key frames of a segment that are not forgotten, in memory or not."""
    return [n for n in sorted(map_.away.union(map_.remembered)) if map_.keyframes[n].segment == segment]


def _is_earlier(map_: Map, number: int) -> bool:
    """Return whether a key frame is in a segment that an earlier session began."""
    segment = map_.keyframes[number].segment
    return any(k.segment == segment for k in map_.keyframes[: map_.earlier])
