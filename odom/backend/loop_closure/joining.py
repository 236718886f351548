"""Parts of a map that were made separately are joined where many recognitions agree.

No camera can look again, and one recognition by descriptors alone can be wrong: of a thing that was carried elsewhere,
or of a room with the same furniture. So two parts are merged by the recognition with which most others between them
agree (pairwise consistency: J. Mangelson et al., ICRA 2018), and only where several agree and where most key frames
near one of the other part are recognised. All others are refused.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from odom.backend.loop_closure.closing import close_loops, merge_segment
from odom.backend.loop_closure.tuning import TUNING
from odom.backend.loop_closure.verification import disagreement
from odom.backend.map.keyframe import pose_distances
from odom.backend.map.map import Map
from odom.backend.map.pose_covariance import independent_covariance
from odom.backend.map.pose_graph import Edge
from odom.geometry import se3
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class Joined:
    """The recognitions that became registrations, and how many were refused."""

    closures: tuple[Edge, ...]
    refused: int


@dataclass(frozen=True, eq=False)
class _Join:
    """A recognition between two segments, and those that agree with it, itself among them."""

    seed: Edge
    agreeing: tuple[Edge, ...] = ()


def join_parts(map_: Map, recognised: Sequence[Edge], calibration_error: float) -> Joined:
    """Merge the segments of a map that `recognised` registrations join, and adjust its key frames to all that agree.

    Of two, the one of the higher number moves. `calibration_error` is the share of a motion by which chains may err as
    a whole.
    """
    weighed = dict(zip(recognised, _weighed(recognised), strict=True))
    closures: list[Edge] = []
    while (join := _surest(map_, recognised, calibration_error)) is not None:
        merge_segment(map_, weighed[join.seed])
        closures += [replace(weighed[agreeing], is_loop=True) for agreeing in join.agreeing]
    close_loops(map_, closures)
    return Joined(tuple(closures), len(recognised) - len(closures))


def _weighed(recognised: Sequence[Edge]) -> list[Edge]:
    """Return the recognitions with covariances enlarged by how many share each key frame.

    A key frame's features err alike in all recognitions in which it takes part: together these say no more than one.
    Those of key frames around it, which see the same things, say little more (`join_alike`).
    """
    parts = Counter(chain.from_iterable((edge.a, edge.b) for edge in recognised))
    times = [0.5 * TUNING.join_alike * (parts[e.a] + parts[e.b]) for e in recognised]
    return [
        replace(e, covariance=n * independent_covariance(e.covariance)) for n, e in zip(times, recognised, strict=True)
    ]


def _surest(map_: Map, recognised: Sequence[Edge], calibration_error: float) -> _Join | None:
    """Return the recognition between two segments with which most others agree, None where too few do for any two."""
    between: defaultdict[tuple[int, int], list[Edge]] = defaultdict(list)
    for edge in recognised:
        segments = map_.keyframes[edge.a].segment, map_.keyframes[edge.b].segment
        if segments[0] != segments[1]:
            between[min(segments), max(segments)].append(edge)
    surest: _Join | None = None
    for _, edges in sorted(between.items()):
        for seed in sorted(edges, key=lambda edge: edge.variance)[: TUNING.join_seeds]:
            join = _Join(seed, _agreeing(map_, seed, edges, calibration_error))
            distinct = min(len({e.a for e in join.agreeing}), len({e.b for e in join.agreeing}))
            is_more = surest is None or len(join.agreeing) > len(surest.agreeing)
            if distinct >= TUNING.join_least and is_more and _is_found_again(map_, join):
                surest = join
    return surest


def _is_found_again(map_: Map, join: _Join) -> bool:
    """Return whether most key frames of a segment that the seed puts near one of the other are recognised.

    Near is up to twice the median distance of the recognised ones.
    """
    a, b = map_.keyframes[join.seed.a], map_.keyframes[join.seed.b]
    T_b_a = se3.inverse(b.T_camera_map) @ se3.inverse(join.seed.T_a_b) @ a.T_camera_map
    there = {k.number: k.T_camera_map for k in map_.keyframes if k.segment == a.segment}
    here = {k.number: k.T_camera_map @ T_b_a for k in map_.keyframes if k.segment == b.segment}
    pairs = [(edge.a, edge.b) if edge.a in there else (edge.b, edge.a) for edge in join.agreeing]
    near = TUNING.join_near * float(
        np.median([pose_distances(here[other], there[one][None])[0] for one, other in pairs])
    )
    others = np.array(list(there.values()))
    expected = {number for number, T in here.items() if pose_distances(T, others).min() <= near}
    found = expected.intersection(other for _, other in pairs)
    return len(found) > TUNING.join_share * len(expected)


def _agreeing(map_: Map, seed: Edge, edges: Sequence[Edge], calibration_error: float) -> tuple[Edge, ...]:
    """Return the recognitions that, carried along the chains, put the two segments where the seed puts them."""
    sure = replace(seed, covariance=independent_covariance(seed.covariance))
    from_a, from_b = (map_.registrations.covariances_from(n) for n in (seed.a, seed.b))
    agreeing: list[Edge] = []
    for edge in edges:
        other = edge if edge.a in from_a else edge.seen_from(edge.b)
        if other.a not in from_a or other.b not in from_b:
            continue
        to_a = _chain(map_, seed.a, other.a, from_a).seen_from(other.a)
        way = to_a.then(sure).then(_chain(map_, seed.b, other.b, from_b))
        if not disagreement(way.T_a_b, way.covariance, other, calibration_error):
            agreeing.append(edge)
    return tuple(agreeing)


def _chain(map_: Map, a: int, b: int, covariances: Mapping[int, Array]) -> Edge:
    """Return the motion between two key frames of a segment by its registrations; `covariances` are those from `a`."""
    T_a_b = map_.keyframes[a].T_camera_map @ se3.inverse(map_.keyframes[b].T_camera_map)
    return Edge(a, b, T_a_b, covariances[b])
