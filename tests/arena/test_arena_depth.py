"""Each fault by itself, on planes whose depth is known; and the ranges in the room."""

import numpy as np
import pytest
from numpy.typing import NDArray

from sensors.arena import ArenaOptions, frame, kinect1, kinect2
from sensors.arena.noise_tiles import Tiles, make_tiles
from sensors.arena.renderer import DepthView

Depth = NDArray[np.float32]


@pytest.fixture(scope="module")
def tiles() -> Tiles:
    return make_tiles(1)


def seen(depth_m: NDArray[np.float64]) -> DepthView:
    """Return what the renderer says of surfaces that face the camera, one number a distinct depth."""
    values, identity = np.unique(depth_m, return_inverse=True)
    surface = identity.reshape(depth_m.shape).astype(np.int16)
    return DepthView((1 / depth_m).astype(np.float32), surface, values.astype(np.float32))


def by_kinect1(depth_m: NDArray[np.float64], tiles: Tiles, frame_index: int = 0, infrared: float = 0.5) -> Depth:
    values = np.full(len(np.unique(depth_m)), infrared, np.float32)
    return kinect1.measured_depth(seen(depth_m), values, tiles, np.random.default_rng(frame_index))


def by_kinect2(samples: list[NDArray[np.float64]], tiles: Tiles, frame_index: int = 0, infrared: float = 0.5) -> Depth:
    values = np.full(8, infrared, np.float32)
    views = [seen(depth_m) for depth_m in samples]
    return kinect2.measured_depth(views[0].inverse_depth, views, values, tiles, np.random.default_rng(frame_index))


def wall(z: float, shape: tuple[int, int] = kinect1.SHAPE) -> NDArray[np.float64]:
    return np.full(shape, z)


def test_kinect1_depth_lies_on_the_steps_of_its_disparity(tiles: Tiles) -> None:
    ramp = np.broadcast_to(np.linspace(0.8, 4.0, 640), kinect1.SHAPE).copy()
    z = np.unique(by_kinect1(ramp, tiles))[1:]
    steps = kinect1.STEP * kinect1.FOCAL_PX * kinect1.BASELINE_M / z
    assert np.allclose(steps, np.rint(steps), atol=2e-3)
    assert 200 < z.size < 450
    assert np.diff(z[z > 3]).min() > 0.02


def test_kinect1_error_grows_with_the_square_of_depth(tiles: Tiles) -> None:
    def deviation(z: float) -> float:
        depths = [z + 0.003 * k for k in range(6)]
        images = [by_kinect1(wall(depth), tiles, k) for k, depth in enumerate(depths)]
        return float(np.mean([np.std(image[image > 0]) for image in images]))

    at_1, at_2, at_3 = (deviation(z) for z in (1.0, 2.0, 3.0))
    assert 0.0008 < at_1 < 0.0035
    assert 3.0 < at_2 / at_1 < 5.5
    assert 1.9 < at_3 / at_2 < 3.2


def test_kinect1_errors_come_in_patches(tiles: Tiles) -> None:
    measured = by_kinect1(wall(2.5), tiles)
    error = np.where(measured > 0, measured - 2.5, 0.0)
    error -= error.mean()
    neighbour = (error[:, 1:] * error[:, :-1]).mean() / error.var()
    distant = (error[:, 20:] * error[:, :-20]).mean() / error.var()
    assert neighbour > 0.35
    assert abs(distant) < 0.1


def test_kinect1_noise_has_a_part_that_stays_and_a_part_that_changes(tiles: Tiles) -> None:
    images = np.stack([by_kinect1(wall(2.0), tiles, k) for k in range(20)]) - 2.0
    temporal, fixed = images.std(axis=0).mean(), images.mean(axis=0).std()
    assert 0.3 < fixed / temporal < 1.5


def test_kinect1_shadows_lie_left_of_near_things(tiles: Tiles) -> None:
    """The projector stands right of the infrared camera: what a near thing hides from it is on the thing's left."""
    scene = wall(3.0)
    scene[150:330, 280:360] = 1.0
    measured = by_kinect1(scene, tiles)
    expected = kinect1.FOCAL_PX * kinect1.BASELINE_M * (1 / 1.0 - 1 / 3.0)
    left = (measured[180:300, 200:280] == 0).sum(axis=1).mean()
    right = (measured[180:300, 362:440] == 0).sum(axis=1).mean()
    assert abs(left - expected) < 3
    assert right < 3


@pytest.mark.parametrize("z", [0.4, 5.0])
def test_kinect1_sees_nothing_too_near_or_too_far(tiles: Tiles, z: float) -> None:
    assert not by_kinect1(wall(z), tiles).any()


def test_kinect1_sees_no_glass_and_dark_things_less_far(tiles: Tiles) -> None:
    assert not by_kinect1(wall(1.5), tiles, infrared=0.0).any()
    assert (by_kinect1(wall(1.2), tiles, infrared=0.03) > 0).mean() > 0.9
    assert (by_kinect1(wall(3.5), tiles, infrared=0.03) > 0).mean() < 0.2
    assert (by_kinect1(wall(3.5), tiles, infrared=0.5) > 0).mean() > 0.95


def test_kinect1_edges_wander_but_nothing_flies_between(tiles: Tiles) -> None:
    scene = wall(3.0)
    scene[:, 320:] = 1.5
    measured = by_kinect1(scene, tiles)
    assert not ((measured > 1.7) & (measured < 2.7)).any()
    first_near = [int(np.argmax(row < 2)) for row in np.where(measured > 0, measured, 9)]
    assert 0.3 < np.std(first_near) < 2.5


def test_kinect2_depth_flies_between_near_and_far(tiles: Tiles) -> None:
    near, far = wall(1.5, kinect2.SHAPE), wall(2.1, kinect2.SHAPE)
    samples = []
    for k in range(4):
        sample = far.copy()
        sample[:, 200 + (k < 2) :] = near[0, 0]
        samples.append(sample)
    measured = by_kinect2(samples, tiles)
    edge = measured[:, 200]
    assert ((edge > 1.55) & (edge < 2.05)).mean() > 0.8
    assert ((measured[:, 205:400] > 1.45) & (measured[:, 205:400] < 1.55)).all()


def test_kinect2_noise_grows_with_range_and_with_darkness(tiles: Tiles) -> None:
    def deviation(z: float, infrared: float) -> float:
        flat = wall(z, kinect2.SHAPE)
        images = np.stack([by_kinect2([flat] * 4, tiles, k, infrared) for k in range(8)])
        return float(images.std(axis=0)[180:240, 220:290].mean())

    at_1, at_3 = deviation(1.0, 0.6), deviation(3.0, 0.6)
    assert 0.0002 < at_1 < 0.003
    assert 2 < at_3 / at_1 < 20
    assert deviation(3.0, 0.3) > 1.3 * at_3


def test_kinect2_is_pulled_outwards_by_light_on_detours(tiles: Tiles) -> None:
    measured = by_kinect2([wall(2.0, kinect2.SHAPE)] * 4, tiles)
    assert 0.001 < np.median(measured) - 2.0 < 0.02


def test_kinect2_sees_nothing_beyond_its_light(tiles: Tiles) -> None:
    assert not by_kinect2([wall(4.9, kinect2.SHAPE)] * 4, tiles).any()
    assert not by_kinect2([wall(2.0, kinect2.SHAPE)] * 4, tiles, infrared=0.0).any()


@pytest.mark.parametrize("sensor", ["kinect1", "kinect2"])
def test_noise_differs_from_frame_to_frame_at_rest(sensor: str) -> None:
    options = ArenaOptions.from_texts({"walk": "rest", "sensor": sensor})
    a, b = frame(options, 10), frame(options, 11)
    assert (a.depth_mm != b.depth_mm).mean() > 0.05
    assert 1.0 < (a.rgb.astype(int) - b.rgb).std() / np.sqrt(2) < 5.0
    assert 0.03 < (a.depth_mm == 0).mean() < 0.6
