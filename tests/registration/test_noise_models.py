import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from odom.errors import InputError
from odom.frame import Camera
from odom.registration import (
    Generic,
    KinectV1,
    KinectV1Incidence,
    KinectV2,
    ZLevels,
    back_project,
    point_covariances,
)

CAMERA = Camera(640, 480, 525.0, 520.0, 319.5, 239.5)
MODELS = [KinectV1(), KinectV1Incidence(), KinectV2(), Generic(), ZLevels.kinect_v1()]
every = pytest.mark.parametrize("model", MODELS, ids=lambda m: type(m).__name__)


@every
@given(u=st.floats(0, 639), v=st.floats(0, 479), z=st.floats(0.4, 8.0), slant=st.floats(0.0, 1.5))
def test_covariances_are_symmetric_and_positive(model, u, v, z, slant):
    C = point_covariances(model, CAMERA, np.array([[u, v]]), np.array([z]), np.array([slant]))[0]
    np.testing.assert_array_equal(C, C.T)
    assert np.linalg.eigvalsh(C)[0] > 0.0


@every
def test_covariance_is_that_of_sampled_pixels_and_depths(model, rng):
    uv, z = np.array([[600.0, 100.0]]), np.array([2.5])
    sigma_px, sigma_z = model.sigmas(z)
    n = 200_000
    pixels = uv + rng.normal(0.0, sigma_px, (n, 2))
    points = back_project(CAMERA, pixels, z + rng.normal(0.0, sigma_z, n))
    C = point_covariances(model, CAMERA, uv, z)[0]
    np.testing.assert_allclose(np.cov(points.T), C, atol=0.03 * np.abs(C).max())


@every
def test_noise_grows_with_depth(model):
    z = np.linspace(1.0, 6.0, 30)
    assert (np.diff(model.sigmas(z)[1]) > 0.0).all()


def test_kinect_v1_is_khoshelhams_figure_and_the_quantisation():
    z = np.array([1.0, 3.0, 5.0])
    step = 1e-3 * (2.73 * z**2 + 0.74 * z - 0.58)
    np.testing.assert_allclose(KinectV1().sigmas(z)[1], np.sqrt((1.425e-3 * z**2) ** 2 + step**2 / 12), rtol=1e-12)


def test_kinect_v2_is_fankhausers_figure():
    np.testing.assert_allclose(KinectV2().sigmas(np.array([2.0]), 0.0)[1], [1e-3 * (1.5 - 1.0 + 1.2)])
    steep = np.deg2rad(60)
    slanted = 1.7 + 0.1 * 2.0**1.5 * steep**2 / (np.pi / 2 - steep) ** 2
    np.testing.assert_allclose(KinectV2().sigmas(np.array([2.0]), steep)[1], [1e-3 * slanted])


def test_incidence_makes_nguyens_noise_larger():
    flat, steep = (KinectV1Incidence().sigmas(np.array([1.0]), a)[1] for a in (0.0, 1.3))
    np.testing.assert_allclose(flat**2, (0.0012 + 0.0019 * 0.36) ** 2 + (1e-3 * 2.89) ** 2 / 12)
    assert steep > 1.2 * flat


def test_z_levels_of_the_kinect_are_some_8_mm_at_a_metre():
    z = np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(ZLevels.kinect_v1().sigmas(z)[1], 8.5e-3 * z**2 * 1.08, rtol=0.1)


def test_z_levels_are_half_the_distance_of_the_levels_i_away():
    levels = np.cumsum(np.arange(1.0, 12.0))
    for i in (1, 3):
        sigma = ZLevels(levels, i).sigmas(levels[[5]])[1]
        np.testing.assert_allclose(sigma, 0.5 * (levels[5 + i] - levels[5 - i]))


@every
def test_whole_metres_have_the_sigmas_of_the_same_metres_as_fractions(model):
    np.testing.assert_array_equal(model.sigmas(np.array([1, 2])), model.sigmas(np.array([1.0, 2.0])))


def test_pixels_and_depths_of_any_type_of_numbers_are_projected_back():
    uv, z = [[3, 200], [255, 1]], [1, 2]
    expected = back_project(CAMERA, np.array(uv, float), np.array(z, float))
    np.testing.assert_array_equal(back_project(CAMERA, uv, z), expected)
    np.testing.assert_array_equal(back_project(CAMERA, np.array(uv, np.uint8), np.array(z, np.float32)), expected)


@pytest.mark.parametrize(("uv", "z"), [(np.ones((2, 5)), np.ones(5)), (np.ones((5, 2)), np.ones(4)), ([1, 2], 3)])
def test_pixels_without_a_depth_each_are_not_projected_back(uv, z):
    with pytest.raises(InputError, match="n x 2"):
        back_project(CAMERA, uv, z)


def test_z_levels_are_learnt_from_the_depths_a_sensor_has_shown():
    depth = np.zeros((4, 5), np.uint16)
    depth.ravel()[:10] = [1000, 1010, 1022, 1034, 1047, 1060, 1074, 1074, 1000, 65535]
    model = ZLevels.from_depth(depth, i=3)
    np.testing.assert_allclose(model.levels_m, [1.0, 1.01, 1.022, 1.034, 1.047, 1.06, 1.074])
    np.testing.assert_allclose(model.sigmas(np.array([1.033]))[1], 0.5 * (1.074 - 1.0))
    np.testing.assert_allclose(model.sigmas(np.array([0.1, 9.0]))[1], 0.5 * (1.074 - 1.0))


def test_the_papers_covariance_is_of_rank_one_along_the_ray_without_the_pixel():
    uv, z = np.array([[500.0, 400.0]]), np.array([2.0])
    C = point_covariances(ZLevels.kinect_v1(pixel_sigma=0.0), CAMERA, uv, z)[0]
    w, V = np.linalg.eigh(C)
    ray = back_project(CAMERA, uv, z)[0]
    assert w[1] < 1e-12 * w[2]
    np.testing.assert_allclose(np.abs(V[:, 2] @ ray), np.linalg.norm(ray))


@pytest.mark.parametrize("depth", [0.0, -1.0, np.nan, np.inf])
def test_a_pixel_without_a_measurement_is_an_error(depth):
    with pytest.raises(InputError, match="depth"):
        point_covariances(KinectV1(), CAMERA, np.zeros((2, 2)), np.array([1.0, depth]))


@pytest.mark.parametrize(
    "arguments", [(np.arange(5.0) + 1, 3), (np.ones(9), 3), (np.arange(9.0)[::-1], 3), (np.arange(9.0), 0)]
)
def test_levels_that_make_no_table_are_an_error(arguments):
    with pytest.raises(InputError, match="levels"):
        ZLevels(*arguments)


def test_shapes_that_disagree_are_an_error():
    with pytest.raises(InputError, match="shape"):
        point_covariances(KinectV1(), CAMERA, np.zeros((3, 2)), np.ones(2))
