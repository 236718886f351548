"""Whether a key frame shows a place that looks like it: confirmed by tracking the landmarks there."""

from dataclasses import dataclass, replace

import numpy as np

from odom.backend.estimate import LoopCandidate
from odom.backend.loop_closure.closing import joins_fixed_parts
from odom.backend.loop_closure.verification import contradiction_from_start
from odom.backend.map.keyframe import FrameObservations
from odom.backend.map.map import Map
from odom.backend.map.memory import recall_near
from odom.backend.map.pose_graph import Edge
from odom.backend.mapping.keyframe_inserter import KeyframeView
from odom.backend.tracking.frame_tracker import FrameTracker
from odom.backend.tracking.quality import is_known_place
from odom.backend.tracking.relocalisation import agree, was_there_of_late
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.frontend.camera.noise_monitor import NoiseMonitor
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.matching.place_recognition import Recognition
from odom.geometry import se3
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class ConfirmedCandidate:
    """A `candidate` that geometry confirms: the registration, and what the key frame measured of old landmarks."""

    candidate: LoopCandidate
    edge: Edge
    uv: Array
    seen: FrameObservations


def refused_at_once(map_: Map, number: int, recognition: Recognition, noise: NoiseMonitor) -> LoopCandidate | None:
    """Return the candidate of key frame `number` if it is refused at once; None where tracking must decide.

    In a building of look-alike rooms the chain contradicts most of them by metres, before anything is tracked.
    """
    keyframe, place = map_.keyframes[number], map_.keyframes[recognition.candidate]
    registration, refusal = recognition.registration, recognition.refusal
    inliers = 0 if registration is None else int(registration.inliers.sum())
    if registration is not None and not refusal and place.segment == keyframe.segment:
        covariance = noise.covariance_scale * registration.covariance
        closure = Edge(place.number, number, registration.T_target_source, covariance, is_loop=True)
        refusal = contradiction_from_start(place, keyframe, closure, noise.calibration_error)
    return LoopCandidate(keyframe.stamp, place.stamp, inliers, False, refusal) if refusal else None


def track_candidate(
    map_: Map, tracker: FrameTracker, seen: KeyframeView, recognition: Recognition, sensor: SensorModel
) -> ConfirmedCandidate | LoopCandidate:
    """Return a recognition that tracking confirms, with its registration, or the candidate that is refused.

    Fewer landmarks suffice for a segment that was left nearby a few frames ago, as when a camera is found again there,
    and for a key frame in whose view things move: these hide landmarks, and its place was described by what stands.
    """
    keyframe, place = map_.keyframes[seen.keyframe], map_.keyframes[recognition.candidate]
    registration = recognition.registration
    assert registration is not None
    candidate = LoopCandidate(keyframe.stamp, place.stamp, int(registration.inliers.sum()), False, "")
    if joins_fixed_parts(map_, keyframe.segment, place.segment):
        return replace(candidate, reason="joins two parts of a map that is only read")
    T_start = se3.inverse(registration.T_target_source) @ place.T_camera_map
    recall_near(map_, place.number, T_start)
    if place.number in map_.away:
        return replace(candidate, reason="what was saved of it cannot be read")
    tracked = track_place(map_, tracker, seen, place.number, T_start, sensor)
    T_place_keyframe = place.T_camera_map @ tracked.T_map_camera
    candidate = replace(candidate, inliers=tracked.found_again, T_candidate_current=T_place_keyframe)
    is_loop = place.segment == keyframe.segment
    is_other = not is_loop and (
        seen.standing is not None or was_there_of_late(map_, tracked, keyframe.stamp, sensor.clock.period_s)
    )
    if not is_known_place(tracked, is_loop) and not (is_other and agree(tracked, registration, T_start)):
        reason = f"only {tracked.found_again} of {tracked.visible_count} landmarks found again"
        return replace(candidate, reason=reason)
    covariance = tracked.covariance * sensor.noise.covariance_scale
    edge = Edge(place.number, keyframe.number, T_place_keyframe, covariance, is_loop)
    reason = f"{tracked.found_again} landmarks found again"
    reason = reason if is_loop else f"merges two segments: {reason}"
    old = tracked.inlier_landmarks
    observed = FrameObservations.of(old, map_.landmarks, sensor.timing)
    return ConfirmedCandidate(replace(candidate, accepted=True, reason=reason), edge, old.uv, observed)


def add_old_landmarks(map_: Map, found: ConfirmedCandidate) -> None:
    """Add to a key frame the old landmarks that were found in it: by them adjustments join the loop.

    Those that were culled since, or that it has already, are left out.
    """
    landmarks, keyframe, seen = map_.landmarks, map_.keyframes[found.edge.b], found.seen
    map_.journal.note_new_details([keyframe.number])
    new = seen.current(landmarks) & ~np.isin(seen.identities, keyframe.identities[keyframe.current(landmarks)])
    keyframe.rows = np.concatenate([keyframe.rows, seen.rows[new]])
    keyframe.identities = np.concatenate([keyframe.identities, seen.identities[new]])
    keyframe.uv = np.concatenate([keyframe.uv, found.uv[new]])
    change = seen.timing.change_to(keyframe.timing)
    keyframe.measurements = keyframe.measurements.joined(seen.measurements.take(new).retimed(change))


def track_place(
    map_: Map, tracker: FrameTracker, seen: KeyframeView, candidate: int, T_start: Array, sensor: SensorModel
) -> TrackedFrame:
    """Return a key frame's view tracked against key frame `candidate` and those around it.

    Those that the key frame is linked with are left out: they saw its landmarks, or it saw theirs, in this very image.
    One of another segment is tracked twice: loops come again, while two segments may meet once.
    """
    known = map_.linked(seen.keyframe) - {candidate}
    if map_.keyframes[candidate].segment != map_.keyframes[seen.keyframe].segment:
        return tracker.track_twice(seen.view, sensor, T_start, seen.twist, candidate, but=known)
    return tracker.track(seen.view, sensor, T_start, seen.twist, tracker.around(candidate, T_start, known))
