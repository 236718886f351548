"""Wrong calls are refused, and the refusal says what to do."""

import re

import numpy as np
import pytest

import odom

GREY = np.zeros((480, 640), np.uint8)
RGB = np.zeros((480, 640, 3), np.uint8)
DEPTH = np.zeros((480, 640), np.uint16)


@pytest.mark.parametrize("stamp", [0, np.int64(7), odom.from_seconds("1305031102.175304"), -5])
def test_whole_nanoseconds_are_stamps(stamp):
    frame = odom.RgbdFrame(0, stamp, GREY, stamp, DEPTH)
    assert type(frame.stamp) is int
    assert frame.stamp == stamp


@pytest.mark.parametrize("stamp", [1.5, np.float64(2), "3", None, True, 10**19])
@pytest.mark.parametrize("name", ["stamp", "depth_stamp"])
def test_another_stamp_is_refused_and_the_conversion_named(stamp, name):
    with pytest.raises(odom.InputError, match="from_seconds"):
        odom.RgbdFrame(**{"sequence": 0, "stamp": 0, "color": GREY, "depth_stamp": 0, "depth_mm": DEPTH, name: stamp})


def test_stamps_of_two_clocks_are_refused():
    with pytest.raises(odom.InputError, match="one clock"):
        odom.RgbdFrame(0, odom.from_seconds(1305031102), GREY, odom.from_seconds(2.5), DEPTH)


@pytest.mark.parametrize(
    ("color", "advice"),
    [
        (RGB / 255, "255"),
        (RGB.astype(np.float32), "uint8"),
        (RGB.astype(np.int32), "uint8"),
        (DEPTH, "each other's place"),
        (np.zeros((480, 640, 4), np.uint8), ":3"),
        (np.zeros((3, 480, 640), np.uint8), "transpose"),
        (np.zeros((480, 640, 1), np.uint8), ":, 0"),
        (np.zeros((480, 640, 2), np.uint8), "H x W"),
        (np.zeros(480, np.uint8), "H x W"),
        ([[0, 0], [0, 0]], "numpy array"),
    ],
)
def test_another_colour_image_is_refused(color, advice):
    with pytest.raises(odom.InputError, match="colour") as refusal:
        odom.RgbdFrame(0, 0, color, 0, DEPTH)
    assert advice in str(refusal.value)


@pytest.mark.parametrize(
    ("depth", "advice"),
    [
        (DEPTH * 0.001, "1000"),
        (DEPTH.astype(np.float32), "1000"),
        (DEPTH.astype(np.int64), "astype"),
        (DEPTH.astype(np.uint8), "uint16"),
        (DEPTH[:, :, None], ":, 0"),
        (DEPTH[::2, ::2], "registered"),
        (DEPTH.T, "registered"),
        (DEPTH.tolist(), "numpy array"),
        (np.ma.masked_equal(DEPTH, 0), "filled(0)"),
    ],
)
def test_another_depth_image_is_refused(depth, advice):
    with pytest.raises(odom.InputError, match="depth") as refusal:
        odom.RgbdFrame(0, 0, RGB, 0, depth)
    assert advice in str(refusal.value)


def test_the_largest_depth_is_held_as_none_and_the_array_given_is_left():
    given = np.array([[0, 1000], [65534, 65535]], np.uint16)
    frame = odom.RgbdFrame(0, 0, GREY[:2, :2], 0, given)
    assert frame.depth_mm.tolist() == [[0, 1000], [65534, 0]]
    assert given[1, 1] == 65535


@pytest.mark.parametrize("unit", [1, 33, 33_333])
def test_stamps_in_numbers_of_frames_milliseconds_or_microseconds_are_refused(unit):
    odometry = odom.Odometry(odom.Camera(640, 480, 525.0, 525.0, 319.5, 239.5))
    for i in range(4):
        odometry.process(odom.RgbdFrame(i, i * unit, GREY, i * unit, DEPTH))
    with pytest.raises(odom.InputError, match="from_seconds"):
        odometry.process(odom.RgbdFrame(4, 4 * unit, GREY, 4 * unit, DEPTH))
    odometry.process(odom.RgbdFrame(5, 10**8, GREY, 10**8, DEPTH))


@pytest.mark.parametrize("given", [RGB, None, (0, 0, RGB, 0, DEPTH)])
def test_what_is_no_frame_is_refused(given):
    with pytest.raises(odom.InputError, match=r"give odom\.RgbdFrame"):
        odom.Odometry(odom.Camera(640, 480, 525.0, 525.0, 319.5, 239.5)).process(given)


@pytest.mark.parametrize(
    ("arguments", "advice"),
    [
        (((640, 480, 525.0, 525.0, 319.5, 239.5),), "give odom.Camera"),
        ((odom.Camera(640, 480, 525.0, 525.0, 319.5, 239.5), {"max_features": 300}), "give odom.OdometrySettings"),
    ],
)
def test_an_odometry_of_no_camera_or_other_settings_is_refused(arguments, advice):
    with pytest.raises(odom.ConfigError, match=advice):
        odom.Odometry(*arguments)


def test_frames_of_another_size_or_out_of_order_are_refused():
    odometry = odom.Odometry(odom.Camera(640, 480, 525.0, 525.0, 319.5, 239.5))
    with pytest.raises(odom.InputError, match="camera's own"):
        odometry.process(odom.RgbdFrame(0, 0, GREY[:240], 0, DEPTH[:240]))
    odometry.process(odom.RgbdFrame(0, 10**9, GREY, 10**9, DEPTH))
    with pytest.raises(odom.InputError, match="order of time"):
        odometry.process(odom.RgbdFrame(1, 10**9, GREY, 10**9, DEPTH))


def test_colour_turned_from_bgr_by_a_view_is_taken():
    tiles = np.random.default_rng(0).integers(0, 256, (30, 40, 3), dtype=np.uint8)
    bgr = tiles.repeat(8, axis=0).repeat(8, axis=1)
    camera = odom.Camera(320, 240, 262.5, 262.5, 159.5, 119.5)
    depth = np.full((240, 320), 1000, np.uint16)
    view, copy = bgr[:, :, ::-1], bgr[:, :, ::-1].copy()
    first, second = (odom.Odometry(camera).process(odom.RgbdFrame(0, 0, c, 0, depth)) for c in (view, copy))
    assert first.matches == second.matches > 0


@pytest.mark.parametrize(
    "given",
    [
        {"fx": float("nan")},
        {"fy": 0.0},
        {"width": 640.5},
        {"height": -480},
        {"width": "640"},
        {"fx": "525"},
        {"cy": None},
        {"height": [480]},
        {"distortion": (0.1, 0.2, 0.3)},
        {"distortion": None},
        {"distortion": "k1"},
        {"distortion": (0.1, 0.2, 0.3, float("inf"))},
    ],
)
def test_a_camera_that_is_none_is_refused(given):
    with pytest.raises(odom.ConfigError, match=r"give|whole"):
        odom.Camera(**{"width": 640, "height": 480, "fx": 525.0, "fy": 525.0, "cx": 319.5, "cy": 239.5, **given})


@pytest.mark.parametrize("kind", [float, np.float32, np.int16])
def test_sizes_that_are_whole_numbers_of_another_type_are_taken(kind):
    camera = odom.Camera(kind(640), kind(480), 525.0, 525.0, 319.5, 239.5)
    assert (type(camera.width), type(camera.height)) == (int, int)
    assert repr(camera) == repr(odom.Camera(640, 480, 525.0, 525.0, 319.5, 239.5))


def test_distortion_comes_as_opencv_gives_it():
    given = np.array([[0.1, -0.2, 0.001, 0.002, 0.0]])
    camera = odom.Camera(640, 480, 525.0, 525.0, 319.5, 239.5, given)
    assert camera.distortion == tuple(given.ravel())
    assert camera == odom.Camera(640, 480, 525.0, 525.0, 319.5, 239.5, tuple(given.ravel()))


POINTS = np.random.default_rng(0).uniform(-1, 1, (10, 3))
SOUND = np.tile(1e-4 * np.eye(3), (10, 1, 1))


def spoilt(entry, value):
    covariances = SOUND.copy()
    covariances[entry] = value
    return covariances


@pytest.mark.parametrize(
    ("arguments", "advice"),
    [
        ((POINTS, POINTS[:9]), "10 x 3"),
        ((POINTS.T, POINTS.T), "n x 3"),
        ((POINTS, POINTS, SOUND[0]), "10 x 3 x 3"),
        ((POINTS, POINTS, None, SOUND[:9]), "10 x 3 x 3"),
        ((POINTS, POINTS, spoilt((4, 0, 1), 1e-5)), "pair 4 is not finite and symmetric"),
        ((POINTS, POINTS, None, spoilt((5, 2, 2), np.nan)), "pair 5 is not finite and symmetric"),
        ((POINTS, POINTS, None, SOUND, np.ones(9)), "give 10"),
        ((np.ma.masked_greater(POINTS, 0.5), POINTS, None, SOUND), "source points are a masked array"),
        ((POINTS, POINTS, None, np.ma.masked_equal(SOUND, 0.0)), "target covariances are a masked array"),
        (([["a", "b", "c"]], POINTS), "source points are no array of numbers"),
        ((POINTS, POINTS), "covariances"),
        ((np.where(POINTS > 0.5, np.nan, POINTS), POINTS, None, SOUND), "finite"),
        ((POINTS, POINTS, None, spoilt(6, 0.0)), "pair 6 is not positive definite"),
        ((POINTS, POINTS, None, spoilt((7, 1, 1), -1.0)), "pair 7 is not positive definite"),
        ((POINTS, POINTS, None, SOUND, np.full(10, -1.0)), "negative"),
    ],
)
def test_pairs_that_cannot_be_registered_are_refused(arguments, advice):
    with pytest.raises(odom.InputError) as refusal:
        odom.register(odom.Pairs(*arguments))
    assert advice in str(refusal.value)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((np.ma.masked_equal(np.eye(4), 0.0),), "the prior's T_target_source is a masked array: "),
        ((np.eye(4), np.ma.masked_equal(np.eye(6), 0.0)), "the prior's covariance is a masked array: "),
        (("here",), "the prior's T_target_source is no array of numbers"),
        ((np.eye(4), "sure"), "the prior's covariance is no array of numbers"),
    ],
)
def test_a_prior_that_is_no_plain_array_is_told_by_its_name(arguments, words):
    with pytest.raises(odom.InputError, match=re.escape(words)):
        odom.Prior(*arguments)


def test_points_that_are_no_pairs_are_refused():
    with pytest.raises(odom.InputError, match="give Pairs"):
        odom.register(POINTS, POINTS)


def test_a_motion_that_is_no_prior_is_refused():
    with pytest.raises(odom.InputError, match="give Prior"):
        odom.register(odom.Pairs(POINTS, POINTS, SOUND, SOUND), np.eye(4))
    with pytest.raises(odom.InputError, match="give Prior"):
        odom.RecursiveFilter(np.eye(4))


def test_pairs_and_prior_stay_as_they_were_given_when_the_arrays_are_written():
    points, variances, weights, T, P = POINTS.copy(), np.full((10, 3), 1e-4), np.ones(10), np.eye(4), np.eye(6)
    pairs, prior = odom.Pairs(points, points, SOUND, variances, weights), odom.Prior(T, P)
    before = odom.register(pairs, prior)
    for array in (points, variances, weights, T, P):
        array += 0.5
    np.testing.assert_array_equal(odom.register(pairs, prior).T_target_source, before.T_target_source)
    np.testing.assert_array_equal(pairs.weights, np.ones(10))
    np.testing.assert_array_equal(prior.covariance, np.eye(6))


def test_the_class_of_a_noise_model_is_refused():
    camera = odom.Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
    with pytest.raises(odom.InputError, match=r"KinectV1\(\)"):
        odom.point_covariances(odom.KinectV1, camera, [[1, 2]], [1.0])


@pytest.mark.parametrize("seconds", [np.float32(1305031102.175304), np.float32(-1e6), np.float16(5.0)])
def test_seconds_of_too_few_digits_are_no_stamp(seconds):
    with pytest.raises(ValueError, match="float64"):
        odom.from_seconds(seconds)


@pytest.mark.parametrize("seconds", ["", "soon", "nan", float("nan"), float("inf"), 1e12, "1e30"])
def test_what_is_no_time_is_no_stamp(seconds):
    with pytest.raises(ValueError, match="seconds"):
        odom.from_seconds(seconds)


@pytest.mark.parametrize(
    ("seconds", "stamp"),
    [
        ("1305031102.175304", 1305031102175304000),
        (" -1.5 ", -1500000000),
        ("1.305e9", 1305000000 * 10**9),
        (".000000001", 1),
        (0.1, 10**8),
        (3, 3 * 10**9),
        (np.float32(0.5), 5 * 10**8),
    ],
)
def test_seconds_become_nanoseconds(seconds, stamp):
    assert odom.from_seconds(seconds) == stamp


def test_float_stamps_of_a_trajectory_are_refused():
    with pytest.raises(odom.InputError, match="from_seconds"):
        odom.Trajectory(np.array([0.0, 0.1]), np.tile(np.eye(4), (2, 1, 1)))
