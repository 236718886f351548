"""Places seen again: each candidate is tracked, held against the chain, and accepted or refused with a reason."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from odom.backend.estimate import LoopCandidate
from odom.backend.loop_closure.closing import close_loops, merge_segment
from odom.backend.loop_closure.verification import contradiction
from odom.backend.map.keyframe import Keyframe
from odom.backend.map.map import Map
from odom.backend.map.memory import recall_near
from odom.backend.map.pose_graph import Edge
from odom.backend.mapping.background import DescribedKeyframe
from odom.backend.mapping.keyframe_inserter import KeyframeView
from odom.backend.tracking.frame_state import Tracked
from odom.backend.tracking.frame_tracker import FrameTracker
from odom.backend.tracking.quality import is_known_place
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.matching.place_recognition import Recognition
from odom.geometry import se3
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class _Verdict:
    """What is published of a `candidate` and, where it is accepted, the registration and the tracked landmarks."""

    candidate: LoopCandidate
    edge: Edge | None = None
    tracked: Tracked | None = None


def close_recognised(
    map_: Map, tracker: FrameTracker, described: Iterable[DescribedKeyframe], sensor: SensorModel
) -> tuple[LoopCandidate, ...]:
    """Judge the places that key frames look like, close loops and merge segments; return all with their reasons.

    Each is held against the chain as it was before any of them; then all loops are closed at once.
    """
    candidates: list[LoopCandidate] = []
    closures: list[Edge] = []
    for one in described:
        keyframe = map_.keyframes[one.seen.keyframe]
        for recognition in one.recognitions:
            verdict = _judge(map_, tracker, one.seen, recognition, sensor)
            candidates.append(verdict.candidate)
            if verdict.edge is not None and verdict.tracked is not None:
                _add_old_landmarks(map_, keyframe, verdict.tracked, sensor)
                if verdict.edge.is_loop:
                    closures.append(verdict.edge)
                else:
                    merge_segment(map_, verdict.edge)
                break
    close_loops(map_, closures)
    return tuple(candidates)


def track_place(
    map_: Map, tracker: FrameTracker, seen: KeyframeView, candidate: int, T_start: Array, sensor: SensorModel
) -> Tracked:
    """Return a key frame's view tracked against key frame `candidate` and those around it.

    Those that the key frame is linked with are left out: they saw its landmarks, or it saw theirs, in this very image.
    """
    known = map_.linked(seen.keyframe) - {candidate}
    local = tracker.around(candidate, T_start, known)
    return tracker.track(seen.view, sensor, T_start, seen.twist, local)


def _judge(
    map_: Map, tracker: FrameTracker, seen: KeyframeView, recognition: Recognition, sensor: SensorModel
) -> _Verdict:
    keyframe, place = map_.keyframes[seen.keyframe], map_.keyframes[recognition.candidate]
    registration = recognition.registration
    inliers = 0 if registration is None else int(registration.inliers.sum())
    candidate = LoopCandidate(keyframe.stamp, place.stamp, inliers, False, recognition.refusal)
    if recognition.refusal or registration is None:
        return _Verdict(candidate)
    T_start = se3.inverse(registration.T_target_source) @ place.T_camera_map
    recall_near(map_, place.number, T_start)
    tracked = track_place(map_, tracker, seen, place.number, T_start, sensor)
    T_place_keyframe = place.T_camera_map @ tracked.T_map_camera
    candidate = replace(candidate, inliers=tracked.found_again, T_candidate_current=T_place_keyframe)
    is_loop = place.segment == keyframe.segment
    if not is_known_place(tracked, must_agree_with_chain=is_loop):
        reason = f"only {tracked.found_again} of {tracked.visible_count} landmarks found again"
        return _Verdict(replace(candidate, reason=reason))
    noise = sensor.noise
    edge = Edge(place.number, keyframe.number, T_place_keyframe, tracked.covariance * noise.covariance_scale, is_loop)
    refusal = contradiction(map_, edge, noise.calibration_error) if is_loop else ""
    if refusal:
        return _Verdict(replace(candidate, reason=refusal))
    reason = f"{tracked.found_again} landmarks found again"
    reason = reason if is_loop else f"merges two segments: {reason}"
    return _Verdict(replace(candidate, accepted=True, reason=reason), edge, tracked)


def _add_old_landmarks(map_: Map, keyframe: Keyframe, tracked: Tracked, sensor: SensorModel) -> None:
    """Add to a key frame the old landmarks that it was found to see: adjustments then join the loop by them."""
    landmarks = map_.landmarks
    map_.journal.measure([keyframe.number])
    new = tracked.inliers & ~np.isin(tracked.rows, keyframe.rows[keyframe.current(landmarks)])
    rows = tracked.rows[new]
    keyframe.rows = np.concatenate([keyframe.rows, rows])
    keyframe.identities = np.concatenate([keyframe.identities, landmarks.identity[rows]])
    keyframe.uv = np.concatenate([keyframe.uv, tracked.uv[new]])
    values = tracked.measurements.take(new)
    change = keyframe.timing.vector - sensor.timing.vector
    keyframe.measurements = keyframe.measurements.joined(replace(values, values=values.retimed(change)))
