"""Trajectories that a program gives: lists are taken, what cannot be meant is refused with what to give instead."""

import numpy as np
import pytest

import odom
from odom.evaluation.mocap_calibration import CalibrationOptions

STAMPS = np.arange(20) * 100_000_000
POSES = np.tile(np.eye(4), (20, 1, 1))
POSES[:, 0, 3], POSES[:, 1, 3] = np.arange(20), np.sin(np.arange(20))
WALK = odom.Trajectory(STAMPS, POSES)


@pytest.mark.parametrize(
    ("stamps", "poses"),
    [
        (STAMPS.tolist(), POSES.tolist()),
        (tuple(STAMPS), list(POSES)),
        (STAMPS.astype(np.int32), POSES.astype(np.float32)),
        (STAMPS, np.round(POSES).astype(int)),
    ],
)
def test_lists_and_other_numbers_are_taken_as_arrays_of_the_documented_types(stamps, poses):
    made = odom.Trajectory(stamps, poses)
    assert (made.stamps.dtype, made.T_world_body.dtype) == (np.int64, np.float64)
    np.testing.assert_array_equal(made.stamps, STAMPS)
    assert odom.evaluate(made, made).ate_m < 1e-6


def test_no_poses_make_an_empty_trajectory():
    assert len(odom.Trajectory([], np.zeros((0, 4, 4)))) == 0


@pytest.mark.parametrize(
    ("stamps", "poses", "segment", "advice"),
    [
        (STAMPS * 1e-9, POSES, None, "from_seconds"),
        ((STAMPS * 1e-9).tolist(), POSES, None, "from_seconds"),
        (STAMPS, POSES[:, :3], None, "n x 4 x 4"),
        (5, POSES, None, "n x 4 x 4"),
        (STAMPS, POSES.astype(complex), None, "T_world_body"),
        (STAMPS, None, None, "T_world_body"),
        (STAMPS, np.ma.masked_greater(POSES, 5.0), None, "T_world_body .* masked"),
        (STAMPS, [[1, 2], [3]], None, "T_world_body"),
        (STAMPS, POSES, np.zeros(3, int), "segment"),
        (STAMPS, POSES, np.full(20, 0.5), "segment"),
        (STAMPS, POSES, np.full(20, np.nan), "segment"),
        (STAMPS, POSES.transpose(0, 2, 1), None, r"last row of pose 1 is 1 0\.84\d* 0 1, .* transposed"),
        (STAMPS, 2 * POSES, None, "0 0 0 2, not 0 0 0 1"),
    ],
)
def test_other_stamps_and_poses_are_refused(stamps, poses, segment, advice):
    with pytest.raises(odom.InputError, match=advice):
        odom.Trajectory(stamps, poses, segment)


def test_seconds_as_keys_are_not_cut_to_whole_nanoseconds():
    with pytest.raises(odom.InputError, match="from_seconds"):
        odom.Trajectory.by_stamp({0.5: np.eye(4), 1.5: np.eye(4)})


@pytest.mark.parametrize("spoil", [(2, 2, 2, 1), (0, 0, 0, 1), (1, 1, -1, 1)])
def test_poses_that_are_no_rigid_motions_are_not_judged(spoil):
    with pytest.raises(odom.InputError, match="truth: 20 of 20 poses are no rigid motions"):
        odom.evaluate(WALK, odom.Trajectory(STAMPS, POSES @ np.diag(spoil)))


def test_a_trajectory_stays_as_it_was_given_when_the_arrays_are_written():
    stamps, poses, segment = STAMPS.copy(), POSES.copy(), np.zeros(20, np.int64)
    truth = odom.Trajectory(stamps, poses, segment)
    poses[::2, 2, 3] += 0.1
    stamps[5:] += 1
    segment[5:] += 1
    np.testing.assert_array_equal(truth.stamps, STAMPS)
    np.testing.assert_array_equal(truth.segment, np.zeros(20))
    assert odom.evaluate(odom.Trajectory(STAMPS, poses), truth).ate_m > 0.04


@pytest.mark.parametrize("given", [POSES, "estimate.txt", None])
def test_what_is_no_trajectory_is_not_judged(given):
    with pytest.raises(odom.InputError, match=r"truth is a .*odom\.Trajectory"):
        odom.evaluate(WALK, given)


@pytest.mark.parametrize("given", [POSES, 1, None])
def test_what_is_no_trajectory_is_not_calibrated_against(given):
    with pytest.raises(odom.InputError, match=r"truth is a .*odom\.Trajectory"):
        odom.calibrate(WALK, given)
    with pytest.raises(odom.InputError, match=r"estimate is a .*odom\.Trajectory"):
        odom.calibrate(given, WALK)


@pytest.mark.parametrize(
    "given", [POSES[5].T, 2 * POSES[5], np.eye(3), POSES[5] @ np.diag([1, 1, -1, 1]), POSES[5] * np.nan, "camera"]
)
def test_an_imposed_pose_of_the_camera_that_is_none_is_refused(given):
    with pytest.raises(odom.InputError, match="T_body_camera"):
        CalibrationOptions(T_body_camera=given)


def test_an_imposed_pose_of_the_camera_may_be_a_list():
    np.testing.assert_array_equal(CalibrationOptions(T_body_camera=POSES[5].tolist()).T_body_camera, POSES[5])


@pytest.mark.parametrize("given", [{"offset_s": np.nan}, {"offset_s": 1e12}, {"max_gap_s": -1.0}, {"search_s": np.nan}])
def test_imposed_times_that_are_none_are_refused(given):
    with pytest.raises(odom.InputError, match=next(iter(given))):
        CalibrationOptions(**given)


@pytest.mark.parametrize("given", [0.1, {"max_gap_s": 0.1}])
def test_what_are_no_options_are_refused(given):
    with pytest.raises(odom.InputError, match="give EvaluationOptions"):
        odom.evaluate(WALK, WALK, given)
    with pytest.raises(odom.InputError, match="give CalibrationOptions"):
        odom.calibrate(WALK, WALK, given)


@pytest.mark.parametrize("frames", ["x", 20.5, -5])
def test_what_is_no_number_of_frames_is_refused(frames):
    with pytest.raises(odom.InputError, match="total_frames"):
        odom.EvaluationOptions(total_frames=frames)


@pytest.mark.parametrize("gap_s", [-1.0, float("nan"), "0.1"])
def test_a_gap_that_is_none_is_refused(gap_s):
    with pytest.raises(odom.InputError, match="max_gap_s"):
        odom.EvaluationOptions(max_gap_s=gap_s)


def test_files_may_be_named_by_text(tmp_path):
    odom.write_tum(str(tmp_path / "t.txt"), WALK)
    np.testing.assert_array_equal(odom.read_tum(str(tmp_path / "t.txt")).stamps, STAMPS)
