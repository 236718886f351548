"""The stamps of a device whose host's clock is set, or whose first images came late."""

import numpy as np
import pytest

from odom.frame import Stamp
from odom.wire.pairing import Pairer
from sensors.openni2.device_clock import DeviceClock

START = 1_700_000_000_000_000_000
PERIOD_NS = 33_333_333
DEPTH_LATER_NS = 8_000_000


def learnt() -> DeviceClock:
    clock = DeviceClock()
    clock.learn_unit([(index * 33_333, START + index * PERIOD_NS) for index in range(7)], 1e9 / 30)
    return clock


def played(clock: DeviceClock, late_ns: list[int]) -> dict[bool, list[Stamp | None]]:
    """Give the clock colour and depth images, received so much later than they were taken; return their stamps."""
    stamps: dict[bool, list[Stamp | None]] = {True: [], False: []}
    for index, late in enumerate(late_ns):
        for is_color in (True, False):
            taken = index * PERIOD_NS + (0 if is_color else DEPTH_LATER_NS)
            stamps[is_color].append(clock.stamp(is_color, taken // 1000, START + taken + late))
    return stamps


def pairs(stamps: dict[bool, list[Stamp | None]]) -> list[int]:
    """Return the index of each colour image that finds its own depth image; any other pair fails."""
    pairer: Pairer[int, int] = Pairer()
    found = []
    for index, (color, depth) in enumerate(zip(stamps[True], stamps[False], strict=True)):
        found += pairer.add_color(color, index) if color is not None else []
        found += pairer.add_depth(depth, index) if depth is not None else []
    paired = [pair for pair in found if pair.depth is not None]
    assert all(pair.color == pair.depth for pair in paired)
    return [pair.color for pair in paired]


@pytest.mark.parametrize("hours", [1, -1])
def test_stamps_follow_a_host_clock_that_was_set(hours: int) -> None:
    set_by = hours * 3600 * 10**9
    color = played(learnt(), [0] * 300 + [set_by] * 60)[True]
    assert None not in color[-20:]
    last = [stamp for stamp in color[-20:] if stamp is not None]
    assert abs(last[-1] - (START + 359 * PERIOD_NS + set_by)) < 50_000_000
    assert np.diff(last) == pytest.approx(PERIOD_NS, rel=0.01)


@pytest.mark.parametrize(("back_ns", "lost"), [(600_000_000, 20), (980_000_000, 31), (1_100_000_000, 3), (10**13, 3)])
def test_after_a_step_back_colour_and_depth_pair_again_within_a_second(back_ns: int, lost: int) -> None:
    found = pairs(played(learnt(), [0] * 300 + [-back_ns] * 90))
    assert found[-1] >= 388
    assert len(found) >= 389 - lost


@pytest.mark.parametrize("back_ns", [10_000_000, 32_000_000, 33_333_000, 200_000_000, 600_000_000])
def test_no_two_images_of_a_stream_are_stamped_less_than_a_tenth_of_a_period_apart(back_ns: int) -> None:
    # Early in the estimate a quick image after late ones moves the clock back at once.
    for color in played(learnt(), [back_ns] * 5 + [0] * 60).values():
        told = np.array([stamp for stamp in color if stamp is not None])
        assert np.diff(told).min() > PERIOD_NS / 10
        assert len(told) >= 65 - back_ns // PERIOD_NS - 2
