"""What a program does to the arrays that it was given changes nothing of what it is given later."""

import copy
from dataclasses import fields, is_dataclass

import numpy as np
from painted_room import SMALL
from running import Ran, numbers

from odom.backend import Odometry


def spoil(value):
    """Write into every array that a value holds, however deep, but for those that are read-only."""
    if isinstance(value, np.ndarray) and value.flags.writeable:
        value[...] = 7
    elif isinstance(value, tuple):
        for one in value:
            spoil(one)
    elif is_dataclass(value):
        for field in fields(value):
            spoil(getattr(value, field.name))


def test_writing_into_estimates_changes_no_later_one(room_frames, room_ran):
    odometry, estimates = Odometry(SMALL), []
    for frame in room_frames:
        estimate = odometry.process(frame)
        estimates.append(copy.deepcopy(estimate))
        spoil(estimate)
    assert any(e.path for e in estimates)
    assert estimates[-1].second is not None
    assert numbers(Ran(tuple(estimates), odometry.finish(), odometry.timing)) == numbers(room_ran)
