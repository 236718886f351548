"""What confirmed registrations do to the map: loops are closed, segments merged."""

from collections.abc import Sequence

import numpy as np

from odom.backend.loop_closure.graph import SegmentGraph, members_of
from odom.backend.map.map import Map
from odom.backend.map.pose_graph import Edge
from odom.geometry import se3


def close_loops(map_: Map, closures: Sequence[Edge]) -> None:
    """Move key frames at once to where all registrations, including the `closures`, agree best."""
    for closure in closures:
        map_.register(closure)
    for segment in sorted({map_.keyframes[closure.b].segment for closure in closures}):
        graph = SegmentGraph.of(map_, segment)
        graph.take_over(map_, graph.optimised())


def joins_fixed_parts(map_: Map, a: int, b: int) -> bool:
    """Return whether merging segments `a` and `b` would move what a map that is fixed had saved."""
    return map_.is_fixed and a != b and {a, b} <= {k.segment for k in map_.keyframes[: map_.earlier_keyframes]}


def merge_segment(map_: Map, edge: Edge) -> list[int]:
    """Merge the segments that an `edge` registers to each other: the one of the higher number moves.

    So what earlier sessions mapped stays where it is, unless that is two parts (see `joins_fixed_parts`). Returns the
    numbers of the key frames that moved; their covariances then count from the start of the other segment, by way of
    the registration.
    """
    edge = edge.seen_from(min(edge.a, edge.b, key=lambda number: map_.keyframes[number].segment))
    a, b = map_.keyframes[edge.a], map_.keyframes[edge.b]
    merged = [k for k in map_.keyframes if k.segment == b.segment]
    T_old_new = se3.inverse(b.T_camera_map) @ se3.inverse(edge.T_a_b) @ a.T_camera_map
    numbers = np.array(members_of(map_, b.segment))
    T_camera_map = np.array([map_.keyframes[int(n)].T_camera_map @ T_old_new for n in numbers])
    map_.move_keyframes(numbers, T_camera_map)
    map_.journal.note_new_or_moved(k.number for k in merged)
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
    return [k.number for k in merged]
