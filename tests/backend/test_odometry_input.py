"""The whole odometry on input that is wrong, useless or hostile; small images of a painted room."""

from dataclasses import replace

import numpy as np
import pytest
from painted_room import PERIOD, SMALL, START, PaintedRoom, stroll
from running import Ran, check_sanity, numbers, run

from odom.backend import Odometry, OdometrySettings, State
from odom.errors import ConfigError, InputError
from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera, RgbdFrame, Stamp


def made_of(rng, kind, number):
    stamp = Stamp(START + number * PERIOD)
    color = np.zeros((240, 320), np.uint8)
    depth = np.full((240, 320), 1500, np.uint16)
    if kind == "noise":
        color = rng.integers(0, 256, (240, 320), dtype=np.uint8)
        depth = rng.integers(0, 65536, (240, 320), dtype=np.uint16)
    elif kind == "noise over a wall":
        color = rng.integers(0, 256, (240, 320), dtype=np.uint8)
    elif kind == "stripes":
        color[:, ::8] = 255
    elif kind == "far":
        color = rng.integers(0, 256, (240, 320), dtype=np.uint8)
        depth[:] = 65535
    return RgbdFrame(number, stamp, color, stamp, depth)


def test_a_perfect_small_stream_is_tracked_to_a_few_millimetres(room_frames, room_ran):
    check_sanity(room_ran)
    assert set(room_ran.states) == {State.TRACKING}
    truth = Trajectory(np.array([f.stamp for f in room_frames]), np.array([stroll(k / 30.0) for k in range(60)]))
    assert room_ran.judged(truth).ate_m < 0.004
    assert numbers(run(SMALL, room_frames)) == numbers(room_ran)


@pytest.mark.parametrize("apart_ns", [1, 10, 1_000, 100_000])
def test_stamps_hardly_apart_at_the_start_do_not_end_the_run(apart_ns, room_frames):
    hardly_later = Stamp(room_frames[0].stamp + apart_ns)
    second = replace(room_frames[1], stamp=hardly_later, depth_stamp=hardly_later)
    ran = run(SMALL, [room_frames[0], second, *room_frames[2:12]])
    check_sanity(ran)
    assert ran.states[0] is State.TRACKING
    assert all(e.T_odom_camera is not None and e.segment == 0 for e in ran.estimates[1:])
    assert set(ran.states[3:]) == {State.TRACKING}


def test_a_frame_that_is_not_of_the_cameras_size_is_refused_and_the_next_one_is_tracked(room_frames):
    odometry = Odometry(SMALL, OdometrySettings())
    for f in room_frames[:10]:
        odometry.process(f)
    big = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
    with pytest.raises(InputError, match="camera"):
        odometry.process(PaintedRoom().frame(big, 10, stroll(10 / 30.0)))
    assert odometry.process(room_frames[10]).state is State.TRACKING
    assert len(odometry.finish()) == 11


def test_a_camera_of_hardly_any_pixels_is_refused():
    with pytest.raises(ConfigError, match="pixels"):
        Odometry(Camera(1, 1, 1.0, 1.0, 0.0, 0.0), OdometrySettings())


def test_arrays_that_are_no_images_are_refused():
    depth = np.zeros((240, 320), np.uint16)
    for color in (np.zeros((240, 320)), np.zeros((240,), np.uint8), np.zeros((120, 160), np.uint8)):
        with pytest.raises(InputError):
            RgbdFrame(0, START, color, START, depth)
    with pytest.raises(InputError):
        RgbdFrame(0, START, np.zeros((240, 320), np.uint8), START, depth.astype(np.int32))


@pytest.mark.parametrize("kind", ["noise", "noise over a wall", "black", "stripes", "far"])
def test_images_that_show_nothing_are_never_tracked_on(kind):
    rng = np.random.default_rng(0)
    ran = run(SMALL, [made_of(rng, kind, k) for k in range(12)])
    check_sanity(ran)
    assert State.TRACKING not in ran.states[1:]


@pytest.mark.parametrize("kind", ["noise", "noise over a wall", "black", "stripes", "far"])
def test_rubbish_amid_a_walk_is_not_believed_and_the_walk_goes_on_after_it(kind, room_frames):
    rng = np.random.default_rng(1)
    frames = [f if not 25 <= k < 33 else made_of(rng, kind, k) for k, f in enumerate(room_frames[:45])]
    ran = run(SMALL, frames)
    check_sanity(ran)
    assert not {State.TRACKING, State.RECOVERED} & set(ran.states[25:33])
    assert all(e.state is State.TRACKING and e.segment == 0 for e in ran.estimates[-8:])


def test_a_covered_lens_at_the_start_only_delays_it(room_frames):
    frames = [replace(f, color=np.zeros_like(f.color)) if k < 10 else f for k, f in enumerate(room_frames[:30])]
    ran = run(SMALL, frames)
    check_sanity(ran)
    assert set(ran.states[:10]) == {State.LOST}
    assert set(ran.states[10:]) == {State.TRACKING}


def test_colour_and_grey_give_the_same_poses(room_frames):
    coloured = [replace(f, color=np.repeat(f.color[..., None], 3, axis=2)) for f in room_frames[:15]]
    a, b = run(SMALL, room_frames[:15]), run(SMALL, coloured)
    for x, y in zip(a.online.T_world_body, b.online.T_world_body, strict=True):
        np.testing.assert_allclose(x, y, atol=2e-3)


def test_the_largest_depth_says_that_nothing_was_measured_as_0_does(room_frames):
    frames = [replace(frame, depth_mm=frame.depth_mm.copy()) for frame in room_frames[:20]]
    for frame in frames:
        frame.depth_mm[:, ::9] = 0
    other = [replace(f, depth_mm=np.where(f.depth_mm, f.depth_mm, 65535).astype(np.uint16)) for f in frames]
    poses = [[e.T_odom_camera for e in run(SMALL, given).estimates] for given in (frames, other)]
    np.testing.assert_array_equal(*poses)


@pytest.mark.parametrize("is_grey", [True, False])
def test_the_next_frame_may_be_written_into_the_arrays_of_the_last_one(is_grey, arena):
    camera, shots = arena
    frames = [shot.rgbd() for shot in shots[:40]]
    frames = [replace(f, color=f.color[..., 1]) for f in frames] if is_grey else frames
    color, depth_mm = np.empty_like(frames[0].color), np.empty_like(frames[0].depth_mm)

    def written(frame):
        color[:], depth_mm[:] = frame.color, frame.depth_mm
        return replace(frame, color=color, depth_mm=depth_mm)

    assert numbers(run(camera, map(written, frames))) == numbers(run(camera, frames))


def test_colour_that_was_seen_ahead_is_not_taken_for_the_next_image_in_its_array(arena):
    camera, frames = arena[0], [shot.rgbd() for shot in arena[1][:20]]
    odometry, color = Odometry(camera), frames[0].color.copy()
    estimates = []
    for shot in frames:
        color[:] = 0
        odometry.anticipate(Stamp(shot.stamp - 1), color)  # an image whose depth never comes
        color[:] = shot.color
        estimates.append(odometry.process(replace(shot, color=color)))
    ran = Ran(tuple(estimates), odometry.finish(), odometry.timing)
    assert numbers(ran) == numbers(run(camera, frames))


@pytest.mark.long
def test_another_room_is_a_segment_of_its_own_and_the_first_room_is_known_again():
    first, second = PaintedRoom(0), PaintedRoom(7)
    walk = [stroll(k / 30.0) for k in range(140)]
    rooms = [first] * 30 + [second] * 70 + [first] * 40
    ran = run(SMALL, [room.frame(SMALL, k, walk[k]) for k, room in enumerate(rooms)])
    check_sanity(ran)
    assert {e.segment for e in ran.estimates[:30]} == {0}
    assert all(e.state is not State.TRACKING for e in ran.estimates[34:60])
    assert ran.estimates[99].segment == 1
    back = next(e for e in ran.estimates[100:] if e.state is State.RECOVERED)
    assert back.segment == 0
    assert back.sequence < 130
    assert not any(loop.accepted for e in ran.estimates for loop in e.loops)


def test_an_empty_run_has_an_empty_trajectory():
    assert Odometry(SMALL, OdometrySettings()).finish() == ()
