"""What every spoiler promises: chance by seed and stamp alone, nothing at level zero, more at harder levels."""

from dataclasses import replace

import numpy as np
import pytest

from odom import Camera, RgbdFrame, Trajectory
from odom.evaluation.robustness import color, depth, timing
from odom.evaluation.robustness.axes import AXES, longer
from odom.evaluation.robustness.spoiler import Scene, Stream
from odom.frontend.camera.rolling_shutter import ShutterTiming

CAMERA = Camera(160, 120, 131.0, 131.0, 79.5, 59.5)
BEGIN = 1_700_000_000_000_000_000
STAMPS = BEGIN + np.arange(0, 30_000_000_000, 33_333_333)


def frame(number: int = 3, is_grey: bool = True, after_s: float | None = None) -> RgbdFrame:
    rng = np.random.default_rng(number)
    stamp = int(STAMPS[number]) if after_s is None else BEGIN + round(1e9 * after_s)
    image = rng.integers(20, 230, (15, 20, 3), np.uint8).repeat(8, axis=0).repeat(8, axis=1)
    depth_mm = rng.integers(600, 4000, (120, 160)).astype(np.uint16)
    depth_mm[:10] = 0
    return RgbdFrame(number, stamp, image[..., 0].copy() if is_grey else image, stamp - 9_000_000, depth_mm)


def scene(seed: int = 1) -> Scene:
    path = Trajectory(STAMPS.astype(np.int64), np.tile(np.eye(4), (len(STAMPS), 1, 1)))
    return Scene(seed, BEGIN, CAMERA, path, 1.0, path, ShutterTiming(0.025, -0.03, 0.033))


def equal(a: RgbdFrame, b: RgbdFrame) -> bool:
    return (a.stamp, a.depth_stamp) == (b.stamp, b.depth_stamp) and all(
        np.array_equal(getattr(a, name), getattr(b, name)) for name in ("color", "depth_mm")
    )


AT_ZERO = {
    "blur": lambda f: color.motion_blur(f, 0.0, 1),
    "darkness": lambda f: color.darkness(f, 1.0, 1),
    "exposure": lambda f: color.exposure_swing(f, 0.0, BEGIN),
    "jpeg": lambda f: color.jpeg(f, 100),
    "torn": lambda f: color.torn_rows(f, 0.0, 1),
    "black-outs": lambda f: color.black_out(f, 0.0, BEGIN, 1),
    "dropped": lambda f: timing.one_in(f, 1),
    "holes": lambda f: depth.holes(f, 0.0, 1),
    "range": lambda f: depth.out_of_range(f, 4.0),
    "depth-noise": lambda f: depth.noise(f, 1.0, 1),
}


@pytest.mark.parametrize("name", AT_ZERO)
@pytest.mark.parametrize("is_grey", [True, False])
def test_level_zero_changes_nothing(name, is_grey):
    for number in (0, 7, 70):
        assert equal(AT_ZERO[name](frame(number, is_grey)), frame(number, is_grey))


def test_stamps_and_calibration_at_level_zero_are_as_they_were():
    for stream in Stream:
        assert timing.jitter(stream, BEGIN, 0.0, 1) == timing.late_depth(stream, BEGIN, 0.0) == BEGIN
    assert longer(CAMERA, 0.0) == CAMERA


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: axis.name)
@pytest.mark.parametrize("is_grey", [True, False])
def test_every_level_keeps_size_type_and_stamps_of_a_frame_and_does_not_touch_the_original(axis, is_grey):
    for level in range(len(axis.levels)):
        given = frame(16, is_grey)
        spoilt = axis.spoiler(level, scene()).frame(given)
        assert equal(given, frame(16, is_grey))
        assert (spoilt.sequence, spoilt.stamp, spoilt.depth_stamp) == (16, given.stamp, given.depth_stamp)
        assert spoilt.color.shape == given.color.shape
        assert spoilt.depth_mm.shape == given.depth_mm.shape
        assert spoilt.color.dtype == np.uint8
        assert spoilt.depth_mm.dtype == np.uint16


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: axis.name)
def test_equal_frames_are_spoilt_equally_in_any_order(axis):
    numbers = [1, 5, 32, 64, 200]
    forwards, backwards = axis.spoiler(2, scene()), axis.spoiler(2, scene())
    first = [(forwards.frame(frame(n)), [forwards.stamp(stream, STAMPS[n]) for stream in Stream]) for n in numbers]
    second = [
        (backwards.frame(frame(n)), [backwards.stamp(stream, STAMPS[n]) for stream in Stream])
        for n in reversed(numbers)
    ][::-1]
    for (one, stamps), (other, same) in zip(first, second, strict=True):
        assert stamps == same
        assert one is other is None or equal(one, other)


BY_CHANCE = ["blur", "darkness", "torn", "holes", "depth-noise", "black-outs"]
WITH_PEOPLE = ["passers-by", "blurred-people", "people-near", "people-thinned"]


@pytest.mark.parametrize("name", BY_CHANCE + WITH_PEOPLE)
def test_another_seed_spoils_otherwise(name):
    axis = next(axis for axis in AXES if axis.name == name)
    given = frame(64, after_s=2.1)
    assert not equal(axis.spoiler(1, scene(1)).frame(given), axis.spoiler(1, scene(2)).frame(given))


def test_another_seed_lets_stamps_jitter_otherwise_and_colour_and_depth_jitter_on_their_own():
    assert timing.jitter(Stream.COLOR, BEGIN, 0.01, 1) != timing.jitter(Stream.COLOR, BEGIN, 0.01, 2)
    assert timing.jitter(Stream.COLOR, BEGIN, 0.01, 1) != timing.jitter(Stream.DEPTH, BEGIN, 0.01, 1)


def damage(axis, level: int) -> float:
    """How far the frames of five seconds are from what they were."""
    spoiler, total = axis.spoiler(level, scene()), 0.0
    for number in range(50, 200, 5):
        given = frame(number)
        spoilt = spoiler.frame(given)
        if spoilt is None:
            total += given.color.mean() + given.depth_mm.mean()
            continue
        total += np.abs(spoilt.color.astype(float) - given.color).mean()
        total += np.abs(spoilt.depth_mm.astype(float) - given.depth_mm).mean()
        for stream in Stream:
            total += abs(spoiler.stamp(stream, given.stamp) - given.stamp) * 1e-6
    return total + abs(spoiler.camera(CAMERA).fx - CAMERA.fx)


@pytest.mark.parametrize("axis", AXES, ids=lambda axis: axis.name)
def test_a_harder_level_does_more(axis):
    found = [damage(axis, level) for level in range(len(axis.levels))]
    assert found[0] > 0
    assert found == sorted(found)
    assert len(set(found)) == len(found)


def test_axes_have_names_and_labels_of_their_own():
    assert len({axis.name for axis in AXES}) == len(AXES)
    for axis in AXES:
        assert 3 <= len(axis.levels) == len({level.label for level in axis.levels}) <= 5


def test_a_blurred_edge_is_as_wide_as_the_blur_and_stays_where_it_was():
    for length in (4.0, 9.0, 30.0):
        for angle in (0.0, 0.4, 1.2):
            kernel = color.line_kernel(length, angle)
            reach = len(kernel) // 2
            y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
            assert kernel.sum() == pytest.approx(1)
            assert (kernel * x).sum() == pytest.approx(0, abs=1e-9)
            assert (kernel * y).sum() == pytest.approx(0, abs=1e-9)
            spread = np.sqrt((kernel * (x**2 + y**2)).sum())
            assert length**2 / 12 < spread**2 < length**2 / 12 + 0.6  # a point between pixels covers four of them


def test_in_the_dark_the_image_is_as_dark_as_asked_for_and_the_noise_does_not_shrink_with_the_light():
    even = replace(frame(), color=np.full((120, 160), 200, np.uint8))
    dark = color.darkness(even, 0.25, 1).color.astype(float)
    assert dark.mean() == pytest.approx(50, abs=0.5)
    assert dark.std() == pytest.approx(np.sqrt(2**2 * (1 - 0.25**2) + 0.03 * 200 * 0.25 * 0.75), rel=0.05)
    assert color.darkness(even, 0.0, 1).color.max() < 15


def test_exposure_swings_about_what_it_was():
    means = [
        color.exposure_swing(frame(after_s=t), 1.0, BEGIN).color.mean() / frame(after_s=t).color.mean()
        for t in (0.0, 0.5, 1.5)
    ]
    assert means[0] == pytest.approx(1)
    assert means[1] > 1.5
    assert means[2] == pytest.approx(0.5, abs=0.01)


def test_torn_rows_are_the_share_that_was_asked_for():
    torn = [
        (color.torn_rows(frame(n), 0.25, 1).color != frame(n).color).any(axis=1).reshape(-1, 8).any(axis=1).mean()
        for n in range(80)
    ]
    assert np.mean(torn) == pytest.approx(0.25, abs=0.05)


def test_the_light_goes_out_every_eight_seconds_and_depth_stays():
    seen = {t: color.black_out(frame(after_s=t), 1.0, BEGIN, 1) for t in (1.9, 2.1, 2.9, 3.1, 10.5, 11.5)}
    assert [t for t, spoilt in seen.items() if spoilt.color.mean() < 10] == [2.1, 2.9, 10.5]
    assert all((spoilt.depth_mm == frame(3, after_s=t).depth_mm).all() for t, spoilt in seen.items())
    assert color.light_returns(BEGIN + 2_100_000_000, 1.0, BEGIN) == BEGIN + 3_000_000_000
    assert color.light_returns(BEGIN + 10_500_000_000, 1.0, BEGIN) == BEGIN + 11_000_000_000
    assert color.light_returns(BEGIN + 3_100_000_000, 1.0, BEGIN) == BEGIN + 3_100_000_000


def test_holes_cover_the_share_that_was_asked_for_and_nothing_else_changes():
    for share in (0.25, 0.9):
        given = frame(5)
        holed = depth.holes(given, share, 1).depth_mm
        is_hole = (holed == 0) & (given.depth_mm > 0)
        assert is_hole.sum() / (given.depth_mm > 0).sum() == pytest.approx(share, abs=0.08)
        assert (holed[~is_hole] == given.depth_mm[~is_hole]).all()


def test_depth_is_noisier_and_in_coarser_steps_and_what_was_not_measured_stays_so():
    flat = replace(frame(), depth_mm=np.full((120, 160), 2000, np.uint16))
    noisy = depth.noise(flat, 4.0, 1).depth_mm
    error = noisy.astype(float) - 2000
    kinect_mm = np.hypot(1.425 * 4, (2.73 * 4 + 0.74 * 2 - 0.58) / np.sqrt(12))
    assert error.std() == pytest.approx(4 * kinect_mm, rel=0.15)
    assert abs(error.mean()) < 3
    assert len(np.unique(noisy)) < len(np.unique(depth.noise(flat, 1.5, 1).depth_mm))
    assert (depth.noise(frame(), 4.0, 1).depth_mm[:10] == 0).all()
    assert (depth.noise(frame(), 16.0, 1).depth_mm[10:] > 0).all()


def test_jitter_has_its_deviation_and_lag_touches_depth_alone():
    for stream in Stream:
        off = np.array([timing.jitter(stream, stamp, 0.01, 1) - stamp for stamp in STAMPS.tolist()]) * 1e-9
        assert off.std() == pytest.approx(0.01, rel=0.1)
        assert abs(off).max() < 0.0301
    assert timing.late_depth(Stream.DEPTH, BEGIN, 0.04) == BEGIN + 40_000_000
    assert timing.late_depth(Stream.COLOR, BEGIN, 0.04) == BEGIN


def test_one_frame_in_four_is_left():
    assert [n for n in range(12) if timing.one_in(frame(n), 4)] == [0, 4, 8]


def test_a_wrong_focal_length_is_wrong_by_as_much_as_asked_for():
    wrong = longer(CAMERA, 5.0)
    assert (wrong.fx / CAMERA.fx, wrong.fy / CAMERA.fy) == pytest.approx((1.05, 1.05))
    assert (wrong.cx, wrong.cy, wrong.width) == (CAMERA.cx, CAMERA.cy, CAMERA.width)
