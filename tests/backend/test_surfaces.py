"""A camera whose colour shows nothing: followed by surfaces of depth images, and LOST where these have no shape."""

from dataclasses import replace

import numpy as np
import pytest
from painted_room import AT_ONCE, PERIOD, SMALL, START, PaintedRoom, stroll
from running import Ran, check_sanity, numbers, read_tum_frames, run

from odom.backend import Odometry, State
from odom.frame import Stamp
from odom.geometry import se3

ROOM, REPAINTED = (PaintedRoom(seed, half_size=(0.9, 0.7, 1.3)) for seed in (0, 7))
CORNER = se3.exp(np.array([0, 0, 0, 0, 0.65, 0])) @ se3.exp(np.array([0, 0, 0, -0.45, 0, 0]))
"""T_room_camera of a camera that looks into a corner: three walls are in view."""
DARK = slice(20, 60)
FOLLOWED = "followed by surfaces alone"


def pose(k):
    """T_room_camera of frame `k`, near a corner of the room."""
    return CORNER @ stroll(1.5 * k / 30.0)


def walk():
    return [ROOM.frame(SMALL, k, pose(k)) for k in range(80)]


def grey(frames, chosen=DARK):
    """The frames with a colour that shows nothing in the `chosen` ones."""
    blank = [replace(f, color=np.full_like(f.color, 90)) for f in frames[chosen]]
    return [*frames[: chosen.start], *blank, *frames[chosen.stop :]]


def errors(ran, first, last):
    """The error (6) of the motion between two frames as published, and its covariance since the start at the last."""
    a, b = ran.estimates[first], ran.estimates[last]
    T_first_last = se3.inverse(a.T_odom_camera) @ b.T_odom_camera
    return se3.log(se3.inverse(T_first_last) @ se3.inverse(pose(first)) @ pose(last)), b.covariance


def noisy(frames):
    """The frames with a colour that is noise."""
    rng = np.random.default_rng(5)
    noise = [replace(f, color=rng.integers(0, 256, f.color.shape).astype(np.uint8)) for f in frames[DARK]]
    return [*frames[: DARK.start], *noise, *frames[DARK.stop :]]


def hanging(frames):
    """The frames of a colour camera that hangs."""
    last = frames[DARK.start - 1].color
    return [*frames[: DARK.start], *(replace(f, color=last.copy()) for f in frames[DARK]), *frames[DARK.stop :]]


@pytest.mark.parametrize("spoilt", [grey, noisy, hanging])
def test_where_colour_shows_nothing_the_camera_is_followed_by_surfaces(spoilt):
    ran = run(SMALL, spoilt(walk()), AT_ONCE)
    check_sanity(ran)
    dark = ran.estimates[DARK]
    assert {e.state for e in dark} == {State.UNCERTAIN}
    assert all(e.reason.endswith(FOLLOWED) for e in dark[6:])
    error, covariance = errors(ran, DARK.start - 1, DARK.stop - 1)
    assert np.linalg.norm(error[:3]) < 0.005
    assert np.linalg.norm(error[3:]) < 0.005
    assert error @ np.linalg.solve(covariance, error) < 12.6  # chi-squared with 6 degrees of freedom, 95 %
    assert {e.segment for e in ran.estimates} == {0}
    assert ran.states[-10:] == [State.TRACKING] * 10


def test_once_the_camera_is_found_the_trajectory_behind_leads_there():
    """Depth that is too long by a hundredth while it is dark leads surfaces astray."""
    frames = grey(walk())
    frames[DARK] = [replace(f, depth_mm=np.rint(1.01 * f.depth_mm).astype(np.uint16)) for f in frames[DARK]]
    ran, last = run(SMALL, frames, AT_ONCE), DARK.stop - 1
    check_sanity(ran)
    astray = np.linalg.norm(errors(ran, DARK.start - 1, last)[0])
    T_placed_last = se3.inverse(ran.final[DARK.start - 1].T_map_camera) @ ran.final[last].T_map_camera
    left = np.linalg.norm(se3.log(se3.inverse(T_placed_last) @ se3.inverse(pose(DARK.start - 1)) @ pose(last)))
    assert astray > 0.005
    assert left < 0.3 * astray


def test_the_covariance_grows_while_only_surfaces_lead():
    ran = run(SMALL, grey(walk()))
    sigma = [np.sqrt(np.trace(ran.estimates[k].covariance[:3, :3])) for k in (DARK.start - 1, 30, DARK.stop - 1)]
    assert sigma[0] < sigma[1] < sigma[2] < 0.2


def test_where_what_returns_is_not_known_the_same_segment_goes_on():
    """The walls are painted anew while it is dark."""
    anew = [REPAINTED.frame(SMALL, k, pose(k)) for k in range(DARK.stop, 110)]
    ran = run(SMALL, [*grey(walk())[: DARK.stop], *anew], AT_ONCE)
    check_sanity(ran)
    assert State.LOST not in ran.states
    assert {e.segment for e in ran.estimates} == {0}
    begun = ran.first(State.RECOVERED, START + DARK.stop * PERIOD)
    assert begun.reason.startswith("gone on where surfaces led")
    assert ran.states[-5:] == [State.TRACKING] * 5
    for last in (begun.sequence, 109):
        error, covariance = errors(ran, DARK.start - 1, last)
        assert np.linalg.norm(error[:3]) < 0.01
        assert np.linalg.norm(error[3:]) < 0.01
        assert error @ np.linalg.solve(covariance, error) < 12.6
    final = se3.inverse(ran.final[DARK.start - 1].T_map_camera) @ ran.final[109].T_map_camera
    assert np.linalg.norm(se3.log(se3.inverse(final) @ se3.inverse(pose(DARK.start - 1)) @ pose(109))) < 0.02


def test_before_a_bare_wall_the_camera_is_lost():
    frames = walk()
    wall = np.full_like(frames[0].depth_mm, 900)
    bare = [replace(f, depth_mm=wall) for f in grey(frames)[DARK]]
    ran = run(SMALL, [*frames[: DARK.start], *bare, *frames[DARK.stop :]])
    check_sanity(ran)
    assert set(ran.states[DARK.start + 8 : DARK.stop]) == {State.LOST}
    assert ran.states[-5:] == [State.TRACKING] * 5


@pytest.mark.parametrize("begin", [DARK.start + 15, DARK.start - 10])
def test_bodies_do_not_lead_the_camera_in_the_dark(begin):
    """One comes while it is dark, or before: a box on a third of the view's width, which walks away to the side."""
    frames = walk()
    for k in range(begin, DARK.stop):
        depth, left = frames[k].depth_mm.copy(), 60 + 2 * (k - begin)
        depth[40:, left : left + SMALL.width // 3] = 450
        frames[k] = replace(frames[k], depth_mm=depth)
    ran = run(SMALL, grey(frames))
    check_sanity(ran)
    assert not any(e.reason.endswith(FOLLOWED) for e in ran.estimates[max(DARK.start, begin + 6) : DARK.stop])
    assert State.LOST not in ran.states[-5:]


def test_without_colour_and_depth_the_camera_is_lost_and_not_followed_when_depth_alone_returns():
    frames = grey(walk())
    blind = [replace(f, depth_mm=np.zeros_like(f.depth_mm)) for f in frames[25:45]]
    ran = run(SMALL, [*frames[:25], *blind, *frames[45:]])
    check_sanity(ran)
    assert set(ran.states[35 : DARK.stop]) == {State.LOST}
    assert ran.states[-5:] == [State.TRACKING] * 5


def test_a_lost_depth_image_does_not_end_it():
    frames = grey(walk())
    frames[35] = replace(frames[35], depth_mm=np.zeros_like(frames[35].depth_mm))
    ran = run(SMALL, frames)
    check_sanity(ran)
    assert State.LOST not in ran.states


def test_a_gap_in_the_stream_longer_than_any_prediction_ends_it():
    frames = grey(walk())
    late = [replace(f, stamp=Stamp(f.stamp + 10**9), depth_stamp=Stamp(f.stamp + 10**9)) for f in frames[40:]]
    ran = run(SMALL, [*frames[:40], *late])
    check_sanity(ran)
    assert ran.states[40] is State.LOST


def test_a_step_back_in_time_ends_it_and_moves_no_frame_behind():
    frames = grey(walk())
    again = [replace(f, stamp=Stamp(f.stamp - 10**10), depth_stamp=Stamp(f.stamp - 10**10)) for f in walk()[5:15]]
    ran = run(SMALL, [*frames[:40], *again], AT_ONCE)
    check_sanity(ran)
    assert ran.states[40] in (State.LOST, State.RECOVERED)
    T_placed_last = se3.inverse(ran.final[DARK.start - 1].T_map_camera) @ ran.final[39].T_map_camera
    true = se3.inverse(pose(DARK.start - 1)) @ pose(39)
    assert np.linalg.norm(se3.log(se3.inverse(T_placed_last) @ true)) < 0.01


def test_images_prepared_ahead_change_nothing():
    frames, odometry = grey(walk()), Odometry(SMALL, AT_ONCE)
    estimates = []
    for frame in frames:
        odometry.anticipate(frame.stamp, frame.color)
        estimates.append(odometry.process(frame))
    assert numbers(Ran(tuple(estimates), odometry.finish(), odometry.timing)) == numbers(run(SMALL, frames, AT_ONCE))


def test_two_runs_give_the_same_bytes():
    frames = grey(walk())
    assert numbers(run(SMALL, frames)) == numbers(run(SMALL, frames))


@pytest.mark.parametrize(("first", "limit_m"), [(100, 0.03), (400, 0.03)])
def test_a_second_without_colour_costs_a_kinect_no_pose(shared_data, first, limit_m):
    camera, frames, truth = read_tum_frames(shared_data / "tum_fr1_xyz", first + 110)
    ran = run(camera, grey(frames[first : first + 110], slice(40, 70)))
    check_sanity(ran)
    assert State.LOST not in ran.states
    assert ran.judged(truth).ate_m < limit_m
