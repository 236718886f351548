"""The chain of pairwise registrations: each frame against the one before, honest, no hole while there is sight."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_scene import DEPTH_SIGMA, RAY_SIGMA, points_ahead
from made_up_scene import project as seen_from
from painted_room import SMALL, PaintedRoom, stroll
from running import run

from odom.backend.chain.pairwise import PairwisePose, register_frames
from odom.evaluation.metrics import tangent_errors
from odom.evaluation.report import evaluate
from odom.evaluation.trajectory import Trajectory
from odom.frame import RgbdFrame
from odom.frontend.features.measurement import Measurements
from odom.geometry import se3

STEP = np.array([0.02, -0.01, 0.03, 0.02, -0.03, 0.01])
VARIANCES = np.array([RAY_SIGMA**2, 0.0, RAY_SIGMA**2, DEPTH_SIGMA**2])


def measured(rng, T_camera_world, points):
    """What a camera measures of points (n x 3)."""
    n = len(points)
    values = seen_from(T_camera_world, points) + rng.normal(size=(n, 3)) * np.sqrt(VARIANCES[[0, 2, 3]])
    return Measurements(values, np.zeros((n, 3, 3)), np.tile(VARIANCES, (n, 1)), np.zeros((n, 2)))


def two_frames(seed, n=120):
    """Both frames' measurements of the same points, and T_previous_current."""
    rng = np.random.default_rng(seed)
    T, points = se3.exp(STEP * rng.normal(1.0, 0.3)), points_ahead(rng, n)
    return measured(rng, np.eye(4), points), measured(rng, se3.inverse(T), points), T


def blind(measurements, rows):
    """The measurements without depth in some rows."""
    values = measurements.values.copy()
    values[rows, 2] = np.nan
    return replace(measurements, values=values)


def registered(previous, current, T_hint=None):
    """The pose of a registration that must succeed."""
    found = register_frames(previous, current, np.eye(4) if T_hint is None else T_hint)
    assert isinstance(found, PairwisePose), found
    return found


def nees_of(found, T):
    error = tangent_errors(found.T_previous_current[None], T[None])[0]
    return float(error @ np.linalg.solve(found.covariance, error))


@pytest.mark.parametrize("who", ["neither", "previous", "current", "some of both"])
def test_a_link_is_as_sure_as_it_says_whoever_lacks_depth(who):
    nees = []
    for seed in range(60):
        previous, current, T = two_frames(seed)
        if who == "previous":
            previous = blind(previous, slice(None))
        elif who == "current":
            current = blind(current, slice(None))
        elif who == "some of both":
            previous, current = blind(previous, slice(0, 30)), blind(current, slice(20, 60))
        nees.append(nees_of(registered(previous, current), T))
    assert 4.0 < np.mean(nees) < 8.0  # 6, and a tenth more or less by chance; Cauchy weights add some


def test_registering_backwards_gives_the_inverse_motion_with_the_same_covariance():
    previous, current, _ = two_frames(1)
    there, back = registered(previous, current), registered(current, previous)
    np.testing.assert_allclose(there.T_previous_current @ back.T_previous_current, np.eye(4), atol=2e-4)
    turned = se3.inverse_covariance(back.T_previous_current, back.covariance)
    np.testing.assert_allclose(np.sqrt(np.diag(there.covariance)), np.sqrt(np.diag(turned)), rtol=0.05)


def test_wrong_pairs_have_no_say():
    rng = np.random.default_rng(3)
    previous, current, T = two_frames(3)
    values, wrong = current.values.copy(), rng.permutation(len(current))[:50]
    values[wrong, :2] += rng.uniform(0.02, 0.2, (50, 2))
    found = registered(previous, replace(current, values=values))
    assert not found.inliers[wrong].any()
    assert found.inliers.sum() > 60
    assert nees_of(found, T) < 22.5  # the .999 quantile


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(["few", "nothing", "no overlap", "no depth at all", "a line", "NaN"]))
def test_what_fixes_no_motion_is_no_pose_but_a_reason(seed, what):
    rng = np.random.default_rng(seed)
    previous, current, _ = two_frames(seed, 60)
    if what in ("few", "nothing"):
        rows = np.arange(9 if what == "few" else 0)
        previous, current = previous.take(rows), current.take(rows)
    elif what == "no overlap":
        current = current.take(rng.permutation(60))
    elif what == "no depth at all":
        previous, current = blind(previous, slice(None)), blind(current, slice(None))
    elif what == "a line":
        points = np.linspace([-0.5, 0.1, 1.5], [0.5, 0.1, 1.5], 60)
        previous, current = measured(rng, np.eye(4), points), measured(rng, np.eye(4), points)
    elif what == "NaN":
        previous = replace(previous, values=np.full_like(previous.values, np.nan))
        current = replace(current, values=np.full_like(current.values, np.nan))
    found = register_frames(previous, current, np.eye(4))
    assert isinstance(found, str)
    assert found


def without_depth(frame: RgbdFrame) -> RgbdFrame:
    return replace(frame, depth_mm=np.zeros_like(frame.depth_mm))


def links(ran):
    return [e.pairwise for e in ran.estimates]


def test_every_tracked_frame_is_linked_to_the_one_before_also_where_depth_was_lost(desk):
    camera, frames, truth = desk
    ran = run(camera, [without_depth(f) if i in (50, 90) else f for i, f in enumerate(frames)])
    assert [e.chain is None or bool(e.chain.hole) for e in ran.estimates] == [False] * len(frames)
    assert all(
        link is not None and link.stamp_earlier == before.stamp
        for link, before in zip(links(ran)[1:], ran.estimates, strict=False)
    )
    stamps = np.array([e.stamp for e in ran.estimates])
    chain = Trajectory(stamps, np.array([e.chain.T_chain_camera for e in ran.estimates]))
    assert evaluate(chain, truth).ate_m < 0.012


def test_the_chain_is_the_product_of_its_links_and_holds_the_errors_of_both_its_ends(room_ran):
    T = np.eye(4)
    for k, e in enumerate(room_ran.estimates):
        if e.pairwise is not None:
            T = T @ e.pairwise.T_earlier_current
        np.testing.assert_allclose(e.chain.T_chain_camera, T, atol=1e-9)
        assert np.linalg.eigvalsh(e.chain.covariance)[0] > -1e-15
        if k > 5:  # a link's stamps are sure by then
            assert np.trace(e.chain.covariance) > 0.5 * np.trace(e.pairwise.covariance)


def test_after_frames_that_show_nothing_the_link_goes_to_the_last_one_that_did(room_frames):
    dark = [replace(f, color=np.zeros_like(f.color)) if i in (30, 31) else f for i, f in enumerate(room_frames)]
    ran = run(SMALL, dark)
    assert [ran.estimates[i].chain for i in (30, 31)] == [None, None]
    assert links(ran)[30:32] == [None, None]
    assert ran.estimates[32].chain.hole == ""
    assert links(ran)[32].stamp_earlier == room_frames[29].stamp


@pytest.mark.long
def test_a_hole_is_said_and_the_chain_goes_on_behind_it(room_frames):
    """Another room from one frame to the next: nothing in it was seen before."""
    other = PaintedRoom(seed=5)
    frames = room_frames[:30] + [other.frame(SMALL, k, stroll(k / 30.0)) for k in range(30, 75)]
    ran = run(SMALL, frames)
    holes = [i for i, e in enumerate(ran.estimates) if e.chain is not None and e.chain.hole]
    assert len(holes) == 1
    after = ran.estimates[holes[0]]
    assert after.pairwise is None
    before = [e for e in ran.estimates[: holes[0]] if e.chain is not None][-1]
    np.testing.assert_allclose(after.chain.T_chain_camera, before.chain.T_chain_camera, atol=1e-9)
    assert ran.estimates[-1].pairwise is not None
