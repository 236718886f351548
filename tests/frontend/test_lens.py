import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from odom.errors import ConfigError
from odom.frame import Camera
from odom.frontend.camera.lens import Lens, project, rays_at

small = st.floats(-0.003, 0.003)


@st.composite
def cameras(draw):
    width, height = draw(st.sampled_from([(640, 480), (320, 240), (640, 360), (641, 479)]))
    focal = draw(st.floats(0.75, 1.4)) * width
    plumb_bob = (draw(st.floats(-0.12, 0.25)), draw(st.floats(-0.05, 0.1)), draw(small), draw(small))
    k3 = draw(st.floats(-0.02, 0.02))
    rational = tuple(draw(st.floats(-0.03, 0.03)) for _ in range(3))
    distortion = draw(st.sampled_from([(), plumb_bob, (*plumb_bob, k3), (*plumb_bob, k3, *rational)]))
    centre = width / 2 + draw(st.floats(-20, 20)), height / 2 + draw(st.floats(-20, 20))
    return Camera(width, height, focal, focal * draw(st.floats(0.97, 1.03)), *centre, distortion)


@settings(max_examples=25)
@given(cameras(), st.integers(0, 1000))
def test_projection_undoes_the_ray_of_a_pixel_for_every_lens(camera, seed):
    lens = Lens.of(camera)
    rng = np.random.default_rng(seed)
    uv = rng.uniform((1, 1), (camera.width - 2, camera.height - 2), (200, 2))
    z = rng.uniform(0.3, 8.0, (200, 1))
    points = np.column_stack([rays_at(lens.rays, uv) * z, z])
    seen = project(points, np.eye(4), lens.intrinsics, lens.distortion, camera.width, camera.height, 0.0)
    np.testing.assert_allclose(seen[:, :2], uv, atol=0.01)
    np.testing.assert_allclose(seen[:, 2:], z, rtol=1e-9)


def test_points_outside_the_margin_or_behind_are_not_in_the_image():
    camera = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
    lens = Lens.of(camera)
    points = np.array([[0, 0, 2], [0, 0, -2], [0, 0, 0.05], [5, 0, 2], [-1.2, 0, 2], [0, 0.9, 2]], dtype=np.float64)
    seen = project(points, np.eye(4), lens.intrinsics, lens.distortion, 640, 480, 8.0)
    assert np.isfinite(seen[:, 0]).tolist() == [True, False, False, False, False, False]


@pytest.mark.xfail(strict=True, reason="projection does not know how far out the distortion model holds")
def test_a_barrel_lens_does_not_fold_points_from_far_outside_into_the_image():
    camera = Camera(640, 480, 525.0, 525.0, 319.5, 239.5, (-0.3, 0.0, 0.0, 0.0, 0.0))
    lens = Lens.of(camera)
    x = np.linspace(0.75, 6.0, 200)
    points = np.column_stack([2 * x, np.zeros(200), np.full(200, 2.0)])
    seen = project(points, np.eye(4), lens.intrinsics, lens.distortion, 640, 480, 0.0)
    assert np.isnan(seen[:, 0]).all()


def test_a_model_with_terms_that_projection_does_not_have_is_refused():
    camera = Camera(640, 480, 525.0, 525.0, 319.5, 239.5, (*[0.0] * 8, 0.01, 0.0, -0.01, 0.0))
    with pytest.raises(ConfigError):
        Lens.of(camera)
