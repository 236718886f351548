"""Judging the places that key frames look like: registered, looked at again, held against the chain, acted upon."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from odom.backend.background import Described, Seen
from odom.backend.belief import is_known_place
from odom.backend.closing import Recognition, close_loop, contradiction, merge_segment
from odom.backend.estimate import LoopCandidate
from odom.backend.graph import Edge
from odom.backend.keyframes import Keyframe
from odom.backend.mapper import Mapper
from odom.backend.selfcheck import SelfCheck
from odom.backend.tracking import Tracked
from odom.registration import se3


def close_loops(mapper: Mapper, described: Iterable[Described], check: SelfCheck) -> tuple[LoopCandidate, ...]:
    """Judge what key frames were recognised to show, act on what holds; return all with decisions and reasons."""
    candidates: list[LoopCandidate] = []
    for one in described:
        for recognition in one.recognitions:
            candidates.append(_judge(mapper, one.seen, recognition, check))
            if candidates[-1].accepted:
                break
    return tuple(candidates)


def _judge(mapper: Mapper, seen: Seen, recognition: Recognition, check: SelfCheck) -> LoopCandidate:
    map_ = mapper.map
    keyframe, candidate = map_.keyframes[seen.keyframe], map_.keyframes[recognition.candidate]
    registration = recognition.registration
    inliers = 0 if registration is None else int(registration.inliers.sum())
    verdict = LoopCandidate(keyframe.stamp, candidate.stamp, inliers, False, recognition.refusal)
    if recognition.refusal or registration is None:
        return verdict
    T_start = se3.inverse(registration.T_target_source) @ candidate.T_camera_map
    tracked = mapper.track(seen.view, T_start, seen.twist, candidate.number, check.noise)
    found = tracked.found_again
    T_candidate_keyframe = candidate.T_camera_map @ se3.inverse(tracked.T_camera_map)
    verdict = replace(verdict, inliers=found, T_candidate_current=T_candidate_keyframe)
    is_chained = candidate.segment == keyframe.segment
    if not is_known_place(tracked, is_chained):
        return replace(verdict, reason=f"only {found} of {tracked.looked_for} landmarks found again")
    edge = Edge(candidate.number, keyframe.number, T_candidate_keyframe, tracked.covariance * check.scale)
    if is_chained:
        refusal = contradiction(map_, edge, check.calibration_error)
        if refusal:
            return replace(verdict, reason=refusal)
        close_loop(map_, replace(edge, is_loop=True))
    else:
        merge_segment(map_, edge)
    _remember_sighting(mapper, keyframe, tracked)
    reason = f"{found} landmarks found again"
    return replace(verdict, accepted=True, reason=reason if is_chained else f"merges two segments: {reason}")


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
