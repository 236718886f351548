"""Which landmarks are still there: those whose places the depth images look through have been carried away."""

from odom.backend.map.landmarks import Landmarks
from odom.backend.mapping.tuning import TUNING
from odom.backend.tracking.frame_state import Tracked


def note_sightings(landmarks: Landmarks, tracked: Tracked, since_previous_s: float) -> None:
    """Count what a tracked frame found and what it missed, and remove landmarks that have been gone for long enough.

    One that was hidden is not blamed for it: behind a person who stops, the map stays as it was.
    """
    found, missed, sight = tracked.inlying.rows, tracked.missed, tracked.sight
    landmarks.seen[found] += 1
    landmarks.tried[found] += 1
    landmarks.tried[missed[~sight.hidden]] += 1
    landmarks.gone_s[found] = 0.0
    landmarks.gone_s[missed[~(sight.hidden | sight.seen_through)]] = 0.0
    gone = missed[sight.seen_through]
    landmarks.gone_s[gone] += min(since_previous_s, TUNING.gone_step_s)
    landmarks.cull(gone[landmarks.gone_s[gone] >= TUNING.gone_s])
