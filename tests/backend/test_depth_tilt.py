"""Depth that is measured along an axis turned against the colour camera's: found, and taken out."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_scene import made_up_bundle
from painted_room import AT_ONCE, SMALL, PaintedRoom, stroll, tilted
from running import Ran

from odom.backend import Odometry
from odom.backend.mapping.bundle_adjustment import adjust
from odom.evaluation.report import evaluate
from odom.evaluation.trajectory import Trajectory
from odom.frontend.camera.depth_tilt import DepthTilt, by_tilt, without_tilt
from odom.frontend.features import image_scale
from odom.geometry import se3

TILT = np.array([0.03, -0.02])
ANGLE = st.floats(-0.04, 0.04)


@given(ANGLE, ANGLE, st.integers(0, 1000))
def test_depth_along_a_turned_axis_is_that_along_the_cameras_own_again(a, b, seed):
    points = np.random.default_rng(seed).uniform((-1.0, -1.0, 2.0), (1.0, 1.0, 4.0), (20, 3))
    R_depth_color = se3.exp(np.array([0.0, 0.0, 0.0, b, -a, 0.0]))[:3, :3]
    rays = points[:, :2] / points[:, 2:]
    values = np.column_stack([rays, 1.0 / (points @ R_depth_color[2])])
    found = without_tilt(values, np.array([a, b]))
    np.testing.assert_allclose(found[:, 2] * points[:, 2], 1.0, atol=2.0 * (a * a + b * b) + 1e-12)
    np.testing.assert_array_equal(found[:, :2], rays)


def test_the_derivative_is_that_of_taking_it_out_and_what_has_no_depth_stays_without():
    values = np.random.default_rng(0).uniform(0.1, 0.9, (9, 3))
    values[::3, 2] = np.nan
    step = without_tilt(values, TILT) - values
    np.testing.assert_allclose(by_tilt(values) @ TILT, np.nan_to_num(step), atol=1e-12)
    assert np.isnan(step[::3, 2]).all()
    assert without_tilt(values, np.zeros(2)) is values


@pytest.mark.parametrize("seed", range(3))
def test_an_adjustment_finds_the_tilt_beside_the_timing(seed):
    made = made_up_bundle(seed)
    o = made.observations
    tilted = without_tilt(o.values, -TILT)
    jacobian = np.concatenate([o.jacobian_timing, by_tilt(tilted)], axis=2)
    known = np.diag([0.02**-2] * 3 + [0.02**-2] * 2)
    start = replace(made.start, timing_change=np.zeros(5))
    found = adjust(start, np.arange(7) < 2, replace(o, values=tilted, jacobian_timing=jacobian), known, 20)
    np.testing.assert_allclose(found.timing_change[:3], made.timing_change, atol=0.002)
    np.testing.assert_allclose(found.timing_change[3:], TILT, atol=0.003)


def shown(seen, share=1.0, sigma=0.005):
    """Whether a tilt is shown by adjustments that ask for `seen` (times x 2, rad), each with this `sigma` (rad)."""
    tilt = DepthTilt()
    for angles in seen:
        if not tilt.is_shown:
            tilt = tilt.with_evidence(angles / sigma**2, np.eye(2) / sigma**2, share)
    return tilt.is_shown


NOISE = np.random.default_rng(0).normal(0.0, 0.005, (200, 20, 2))


def test_noise_hardly_ever_shows_a_tilt():
    assert np.mean([shown(seen) for seen in NOISE]) < 0.03
    overlapping = [np.stack([seen[k : k + 7].mean(axis=0) for k in range(14)]) for seen in NOISE]
    assert np.mean([shown(seen, 1.0 / 7.0, 0.005 / np.sqrt(7.0)) for seen in overlapping]) < 0.03


def test_a_tilt_that_bends_a_walk_is_shown_by_the_first_adjustment():
    assert np.mean([shown(seen[:1] + TILT, 1.0 / 7.0) for seen in NOISE]) > 0.97


def test_a_tilt_that_no_adjustment_shows_alone_is_shown_by_many():
    seen = NOISE + TILT / 5.0
    assert np.mean([shown(each[:1]) for each in seen]) < 0.03
    assert np.mean([shown(each) for each in seen]) > 0.97


def test_what_is_not_shown_is_held_at_none_and_what_is_shown_starts_anew():
    held = DepthTilt().with_evidence(np.array([0.1, 0.0]), np.eye(2) * 1e4, 1.0)
    assert not held.is_shown
    assert not held.is_new
    np.testing.assert_array_equal(held.angles, 0.0)
    assert np.linalg.eigvalsh(held.adjusted_information).min() > 1e9
    known = held.with_evidence(np.array([4000.0, 0.0]), np.eye(2) * 1e4, 1.0)
    assert known.is_shown
    assert known.is_new
    np.testing.assert_array_equal(known.adjusted_information, DepthTilt().information)
    assert not known.with_change(TILT, np.eye(2) * 1e4).is_new


def strolled(tilt, frames):
    """The frames of a walk in a painted room whose depth has a tilt, and the walk's truth."""
    T = [stroll(k / 30.0) for k in range(frames)]
    seen = [tilted(PaintedRoom().frame(SMALL, k, T[k]), tilt) for k in range(frames)]
    return seen, Trajectory(np.array([f.stamp for f in seen]), np.array(T))


def walk_through(tilt, frames):
    """The sensor, and the errors of the trajectory in the end and as published, and of the chain: depth has a tilt."""
    seen, truth = strolled(tilt, frames)
    odometry = Odometry(SMALL, AT_ONCE)
    estimates = tuple(odometry.process(frame) for frame in seen)
    ran = Ran(estimates, odometry.finish(), odometry.timing)
    chain = Trajectory(truth.stamps, np.array([e.chain.T_chain_camera for e in estimates]))
    ates_m = [evaluate(each, truth).ate_m for each in (ran.online, chain)]
    return odometry.sensor, ran.judged(truth).ate_m, *ates_m


def walks(frames=90):
    """Walks without and with a tilt of depth, and one with a tilt that nothing shows."""
    found = [walk_through(np.zeros(2), frames), walk_through(TILT, frames)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DepthTilt, "with_evidence", lambda tilt, *_: tilt)
        return [*found, walk_through(TILT, frames)]


@pytest.fixture(scope="module")
def walked():
    """The walks by images of 320 x 240 as they are: these have key frames, which show a tilt, within half a second."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(image_scale, "TUNING", replace(image_scale.TUNING, image_least_side_px=1))
        return walks()


@pytest.mark.long
def test_a_tilt_is_found_on_the_way_and_none_where_there_is_none(walked):
    assert not walked[0][0].depth_tilt.is_shown
    np.testing.assert_array_equal(walked[0][0].depth_tilt.angles, 0.0)
    found = walked[1][0].depth_tilt
    sigma = np.sqrt(np.diag(np.linalg.inv(found.information)))
    assert sigma.max() < 0.006
    assert (np.abs(found.angles - TILT) < 0.002 + 3.0 * sigma).all()


@pytest.mark.long
def test_a_walk_with_tilted_depth_is_as_exact_in_the_end_and_better_at_once(walked):
    (_, *straight_m), (_, *tilted_m), (_, *unknown_m) = walked
    assert straight_m[0] < 0.00015
    assert tilted_m[0] < min(0.0003, 0.2 * unknown_m[0])
    assert tilted_m[1] < min(0.0018, 0.7 * unknown_m[1])
    assert tilted_m[2] < min(0.0016, 0.7 * unknown_m[2])


@pytest.mark.long
def test_a_tilt_is_found_by_enlarged_images_too_though_later():
    (_, *straight_m), (sensor, *tilted_m), (_, *unknown_m) = walks(180)
    assert sensor.depth_tilt.is_shown
    assert straight_m[0] < 0.00015
    assert tilted_m[0] < min(0.0003, 0.2 * unknown_m[0])
    assert tilted_m[1] < 0.7 * unknown_m[1]
