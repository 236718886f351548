import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from odom.frontend.features.depth_plane import PLANE_LIMITS, read_planes

LIMITS = (0.03, *PLANE_LIMITS[1:])
V, U = np.mgrid[0:40, 0:50].astype(np.float64)


def read_plane(depth_mm, u, v, limits):
    return read_planes(depth_mm, np.array([[u, v]]), limits)[0]


def millimetres(inverse_depth):
    return np.rint(1000.0 / inverse_depth).astype(np.uint16)


@given(
    st.floats(0.2, 2.0),
    st.floats(-0.004, 0.004),
    st.floats(-0.004, 0.004),
    st.floats(5.0, 44.0),
    st.floats(5.0, 34.0),
)
def test_a_plane_in_inverse_depth_is_read_to_the_depth_images_resolution(w, slope_u, slope_v, u, v):
    inverse_depth = w * (1.0 + slope_u * (U - u) + slope_v * (V - v))
    found = read_plane(millimetres(inverse_depth), u, v, LIMITS)
    resolution = 0.5e-3 * inverse_depth.max() ** 2
    assert abs(found[0] - w) <= 2.0 * resolution
    assert np.abs(found[1:] - w * np.array([slope_u, slope_v])).max() <= 0.5 * resolution


@given(st.floats(0.3, 1.5), st.floats(1.12, 3.0), st.booleans(), st.floats(5.0, 44.0), st.floats(5.0, 34.0))
def test_no_depth_between_foreground_and_background_is_ever_read(near, ratio, is_upright, u, v):
    edge = 25 if is_upright else 20
    w_near, w_far = near * ratio, near
    is_far = (edge <= U) if is_upright else (edge <= V)
    found = read_plane(millimetres(np.where(is_far, w_far, w_near)), u, v, LIMITS)[0]
    along = round(u) if is_upright else round(v)
    if edge - 2 <= along <= edge + 1:
        assert np.isnan(found)
    else:
        surface = w_far if along >= edge else w_near
        half_a_millimetre = 0.5e-3 * surface**2
        assert np.isnan(found) or abs(found - surface) <= 1.01 * half_a_millimetre


def test_mixed_pixels_on_an_edge_are_refused():
    w = np.where(U < 24, 1.0, 0.5)
    w[:, 24] = 0.75
    for u in (22.0, 23.0, 24.0, 25.0, 26.0):
        assert np.isnan(read_plane(millimetres(w), u, 20.0, LIMITS)[0])


@pytest.mark.parametrize("share", [0.55, 0.7, 1.0])
def test_holes_do_not_bend_the_plane(share):
    rng = np.random.default_rng(3)
    w = 0.6 * (1.0 + 0.003 * (U - 20.0))
    depth = millimetres(w)
    window = np.zeros(49, dtype=bool)
    window[: round(share * 49)] = True
    depth[17:24, 17:24] *= rng.permuted(window).reshape(7, 7)
    assert abs(read_plane(depth, 20.0, 20.0, LIMITS)[0] - 0.6) < 3e-4


def test_too_few_measured_neighbours_or_the_border_give_nothing():
    depth = millimetres(np.full_like(U, 0.5))
    for u, v in ((2.0, 20.0), (47.0, 20.0), (20.0, 1.0), (20.0, 38.0), (np.nan, 20.0), (20.0, np.inf)):
        assert np.isnan(read_plane(depth, u, v, LIMITS)).all()
    depth[17:24, 17:24].flat[:26] = 0
    assert np.isnan(read_plane(depth, 20.0, 20.0, LIMITS)).all()
    assert np.isnan(read_plane(np.zeros_like(depth), 20.0, 20.0, LIMITS)).all()
