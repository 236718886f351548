"""Judging the places that key frames look like: registered, looked at again, held against the chain, acted upon."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from odom.backend.background import Described, Seen
from odom.backend.belief import is_known_place
from odom.backend.closing import Recognition, close_loops, contradiction, merge_segment
from odom.backend.estimate import LoopCandidate
from odom.backend.graph import Edge
from odom.backend.keyframes import Keyframe
from odom.backend.mapper import Mapper
from odom.backend.selfcheck import SelfCheck
from odom.backend.tracking import Tracked
from odom.registration import se3


@dataclass(frozen=True, eq=False)
class _Verdict:
    """What was said of a candidate and, where it was accepted, the registration and the look at its landmarks."""

    said: LoopCandidate
    edge: Edge | None = None
    tracked: Tracked | None = None


def act_on(mapper: Mapper, described: Iterable[Described], check: SelfCheck) -> tuple[LoopCandidate, ...]:
    """Judge what key frames were recognised to show, act on what holds; return all with decisions and reasons.

    Each is held against the chain as it was before any of them; then all loops are closed at once.
    """
    said: list[LoopCandidate] = []
    closures: list[Edge] = []
    for one in described:
        keyframe = mapper.map.keyframes[one.seen.keyframe]
        for recognition in one.recognitions:
            verdict = _judge(mapper, one.seen, recognition, check)
            said.append(verdict.said)
            if verdict.edge is not None and verdict.tracked is not None:
                _remember_sighting(mapper, keyframe, verdict.tracked)
                if verdict.edge.is_loop:
                    closures.append(verdict.edge)
                else:
                    merge_segment(mapper.map, verdict.edge)
                break
    close_loops(mapper.map, closures)
    return tuple(said)


def _judge(mapper: Mapper, seen: Seen, recognition: Recognition, check: SelfCheck) -> _Verdict:
    map_ = mapper.map
    keyframe, candidate = map_.keyframes[seen.keyframe], map_.keyframes[recognition.candidate]
    registration = recognition.registration
    inliers = 0 if registration is None else int(registration.inliers.sum())
    said = LoopCandidate(keyframe.stamp, candidate.stamp, inliers, False, recognition.refusal)
    if recognition.refusal or registration is None:
        return _Verdict(said)
    T_start = se3.inverse(registration.T_target_source) @ candidate.T_camera_map
    tracked = mapper.track_place(seen, candidate.number, T_start, check.noise)
    found = tracked.found_again
    T_candidate_keyframe = candidate.T_camera_map @ se3.inverse(tracked.T_camera_map)
    said = replace(said, inliers=found, T_candidate_current=T_candidate_keyframe)
    is_loop = candidate.segment == keyframe.segment
    if not is_known_place(tracked, is_loop):
        return _Verdict(replace(said, reason=f"only {found} of {tracked.looked_for} landmarks found again"))
    edge = Edge(candidate.number, keyframe.number, T_candidate_keyframe, tracked.covariance * check.scale, is_loop)
    refusal = contradiction(map_, edge, check.calibration_error) if is_loop else ""
    if refusal:
        return _Verdict(replace(said, reason=refusal))
    reason = f"{found} landmarks found again"
    said = replace(said, accepted=True, reason=reason if is_loop else f"merges two segments: {reason}")
    return _Verdict(said, edge, tracked)


def _remember_sighting(mapper: Mapper, keyframe: Keyframe, tracked: Tracked) -> None:
    """Let a key frame hold the old landmarks that it was found to see: the adjustment joins the loop by them."""
    landmarks = mapper.map.landmarks
    new = tracked.inliers & ~np.isin(tracked.rows, keyframe.rows[keyframe.current(landmarks)])
    rows = tracked.rows[new]
    keyframe.rows = np.concatenate([keyframe.rows, rows])
    keyframe.identities = np.concatenate([keyframe.identities, landmarks.identity[rows]])
    keyframe.uv = np.concatenate([keyframe.uv, tracked.uv[new]])
    values = tracked.measurements.take(new)
    change = keyframe.timing.vector - mapper.timing.vector
    keyframe.measurements = keyframe.measurements.joined(replace(values, values=values.retimed(change)))
