"""Closing loops: places that look alike, verified by geometry, held against the chain, and then acted upon."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.backend.graph import Edge, optimise
from odom.backend.history import long_after, wrong_calibration
from odom.backend.map import Map
from odom.frontend.places import Place, PlaceIndex, match_places
from odom.registration import se3
from odom.registration.default import register
from odom.registration.pairs import Registration

Array = NDArray[np.float64]

LEAST_INLIERS = 25
_CANDIDATES = 3
_CHAIN_SIGMA_SCALE = 2.0
_CHI2_6_9999 = 27.86


@dataclass(frozen=True, eq=False)
class Recognition:
    """A key frame that looks like the place, and the registration of the two (None: nothing matched)."""

    candidate: int
    registration: Registration | None

    @property
    def refusal(self) -> str:
        """Why the geometry refuses it; empty where it does not."""
        if self.registration is None:
            return "looks alike, but no features match"
        if not self.registration.ok:
            return f"looks alike, but {self.registration.reason}"
        inliers = int(self.registration.inliers.sum())
        return "" if inliers >= LEAST_INLIERS else f"only {inliers} of {len(self.registration.inliers)} matches agree"


def recognise(index: PlaceIndex, place: Place, excluded: set[int]) -> list[Recognition]:
    """Return the places of `index` that look like `place`, each registered: T_candidate_place."""
    out = []
    for number in index.look_up(place, excluded, _CANDIDATES):
        pairs = match_places(place, index.places[number])
        out.append(Recognition(number, None if pairs is None else register(pairs)))
    return out


def contradiction(map_: Map, edge: Edge, calibration_error: float) -> str:
    """Say how a closure contradicts the chain of key frames between the two; empty where it does not.

    `calibration_error` is the share of a motion by which the chain may err as a whole; both chain and closure are given
    two sigma's credit.
    """
    a, b = map_.keyframes[edge.a], map_.keyframes[edge.b]
    chain = map_.registrations.covariance_between(edge.a, edge.b)
    if chain is None:
        return ""
    T_a_b = a.T_camera_map @ se3.inverse(b.T_camera_map)
    away = se3.log(se3.inverse(T_a_b) @ edge.T_a_b)
    S = chain + wrong_calibration(T_a_b, calibration_error) + long_after(edge.covariance)
    chi2 = float(away @ np.linalg.solve(S * _CHAIN_SIGMA_SCALE**2 + 1e-12 * np.eye(6), away))
    if chi2 <= _CHI2_6_9999:
        return ""
    metres, degrees = np.linalg.norm(away[:3]), np.rad2deg(np.linalg.norm(away[3:]))
    return f"contradicts the chain by {metres:.2f} m and {degrees:.1f} deg ({np.sqrt(chi2):.0f} sigma)"


def close_loops(map_: Map, closures: Sequence[Edge]) -> None:
    """Move the key frames of a segment to where all registrations, the `closures` among them, agree best.

    The oldest one remembered is held, forgotten ones follow.
    """
    for closure in closures:
        map_.register(closure)
    for segment in sorted({map_.keyframes[closure.b].segment for closure in closures}):
        members = map_.members(segment)
        T_map_keyframe = {k.number: se3.inverse(k.T_camera_map) for k in members}
        moved = optimise(T_map_keyframe, members[0].number, map_.registrations.among(T_map_keyframe.keys()))
        numbers = np.array(sorted(moved))
        T_camera_map = np.array([se3.inverse(moved[int(n)]) for n in numbers])
        map_.move_keyframes(numbers, T_camera_map, np.zeros(0, dtype=np.int64))


def merge_segment(map_: Map, edge: Edge) -> None:
    """Carry the whole segment of key frame `edge.b` into the map of `edge.a`'s, to where they were registered.

    It is as sure of that one's start then as the registration allows, and its chain from there.
    """
    a, b = map_.keyframes[edge.a], map_.keyframes[edge.b]
    merged = [k for k in map_.keyframes if k.segment == b.segment]
    T_old_new = se3.inverse(b.T_camera_map) @ se3.inverse(edge.T_a_b) @ a.T_camera_map
    numbers = np.array([k.number for k in map_.members(b.segment)])
    T_camera_map = np.array([map_.keyframes[int(n)].T_camera_map @ T_old_new for n in numbers])
    map_.move_keyframes(numbers, T_camera_map, np.zeros(0, dtype=np.int64))
    for k in merged:
        k.segment, k.first = a.segment, a.first
    map_.register(edge)
    reached, onward = {a.number}, [edge]
    while onward:
        step = onward.pop()
        if step.b not in reached:
            reached.add(step.b)
            onward += [e for e in map_.registrations.of(step.b) if not e.is_loop]
            map_.go_on(step)
