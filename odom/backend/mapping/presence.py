"""Which landmarks are still there: those whose places the depth images look through have been carried away."""

import numpy as np

from odom.backend.map.landmarks import Landmarks
from odom.backend.map.map import Map
from odom.backend.mapping.tuning import TUNING
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.backend.tracking.tuning import TUNING as TRACKING
from odom.geometry.arrays import Array, Index
from odom.geometry.neighbours import nearest


def note_sightings(map_: Map, tracked: TrackedFrame, since_previous_s: float, in_doubt: bool) -> None:
    """Count what a tracked frame found and what it missed, and remove landmarks that have been gone for long enough.

    While the pose is `in_doubt`, one that has departed and is found where it was has perhaps taken the camera along.
    A hidden landmark does not count as missed: behind a person who stops, the map stays as it was. All neighbours of a
    landmark that is removed are looked for in the next frames: they may have lain on the same thing.
    """
    landmarks = map_.landmarks
    found, missed, sight = tracked.inlier_landmarks.rows, tracked.missed, tracked.sight
    landmarks.departed[tracked.elsewhere] = True
    if not in_doubt:
        landmarks.departed[found] = False
    landmarks.seen[found] += 1
    landmarks.tried[found] += 1
    landmarks.tried[missed[~sight.hidden]] += 1
    landmarks.gone_s[found] = 0.0
    landmarks.gone_s[missed[~(sight.hidden | sight.seen_through)]] = 0.0
    gone = missed[sight.seen_through]
    landmarks.gone_s[gone] += min(since_previous_s, TUNING.gone_step_s)
    vanished = gone[landmarks.gone_s[gone] >= TUNING.gone_s]
    map_.journal.note_fewer_landmarks(landmarks.keyframe[vanished].tolist())
    landmarks.cull(vanished)
    if len(vanished):
        near = _around(landmarks, landmarks.position[vanished], tracked.T_map_camera[:3, 3])
        landmarks.gone_s[near] = np.maximum(landmarks.gone_s[near], TUNING.gone_step_s)


def retire(map_: Map, tracked: TrackedFrame, since: int) -> None:
    """Take back what was learnt from a body that a frame was tracked by: those landmarks have departed.

    Landmarks of its segment that were made from the identity `since` on are removed.
    """
    segment = map_.keyframes[tracked.reference].segment
    landmarks = map_.landmarks
    is_member = np.array([keyframe.segment == segment for keyframe in map_.keyframes])
    rows = np.flatnonzero(landmarks.alive & (landmarks.identity >= since))
    rows = rows[is_member[landmarks.keyframe[rows]]]
    map_.journal.note_fewer_landmarks(landmarks.keyframe[rows].tolist())
    landmarks.departed[tracked.inlier_landmarks.rows] = True
    landmarks.cull(rows)


def _around(landmarks: Landmarks, places: Array, eye: Array) -> Index:
    """Return the rows of the landmarks near any of k `places` (k x 3, m), as seen from `eye` (3, m).

    They may lie on one thing: see `departing_within`.
    """
    rows = np.flatnonzero(landmarks.alive)
    if not len(rows):
        return rows
    positions = landmarks.position[rows]
    away_m2 = nearest(positions, places, 1)[1]
    within_m = TRACKING.departing_within * np.linalg.norm(positions - eye, axis=1)
    return np.asarray(rows[away_m2 < within_m**2])
