"""Whether a frame comes so soon after another one that the camera's motion tells where it is."""

from odom.backend.odometry.tuning import TUNING


def is_next(since_s: float, period_s: float) -> bool:
    """Return whether a frame `since_s` seconds after another one follows it, in a stream of one every `period_s`."""
    return 0.0 < since_s < max(TUNING.longest_gap_s, TUNING.longest_gap_periods * period_s)
