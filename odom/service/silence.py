"""What the state is while no frame comes."""

from odom.backend import State

_SILENCE_S = 1.0
"""Without a frame for longer the state is WAITING: the sensor, not the odometry, is to be looked at."""
_LOST_AFTER_S, _LOST_AFTER_PERIODS = 0.12, 2.5
"""A live source that is silent for the longer of the two is reported LOST: two frames were missed. Shorter would report
every delay of the network."""


def state_after(last: State | None, silent_s: float, is_live: bool, fps: float) -> State | None:
    """Return the state so long after the `last` frame's of a source that gives `fps` frames a second; None: WAITING."""
    if last is None or silent_s > _SILENCE_S:
        return None
    is_missed = is_live and silent_s > max(_LOST_AFTER_S, _LOST_AFTER_PERIODS / max(fps, 1.0))
    return State.LOST if is_missed else last
