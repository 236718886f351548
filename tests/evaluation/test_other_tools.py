"""Trajectories as other tools write them: their stamps, the order of their columns, what they write where they lost."""

import contextlib
import json
import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from full_disk import room_for
from hypothesis import given
from hypothesis import strategies as st
from refused import process_as_it_was, refusal
from scipy.spatial.transform import Rotation
from synthetic import smooth, trajectory
from typer.testing import CliRunner, Result

import odom
from odom.cli import app
from odom.cli.trajectories import read_truth
from odom.errors import OdomError
from odom.evaluation import Trajectory
from odom.evaluation.files import read_kitti, read_tum
from odom.geometry import se3

START_S = 1.7e9


@pytest.fixture(scope="module")
def walk() -> Trajectory:
    return trajectory(smooth(np.random.default_rng(0)), np.arange(0, 3, 0.02), START_S)


def pose_fields(T: np.ndarray) -> list[str]:
    """The seven numbers of a pose as TUM's format has them."""
    return [f"{value:.9f}" for value in (*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat())]


def written(path: Path, walk: Trajectory, stamp_text, order=range(7), between=" ", head="", end="") -> Path:
    """A text file with a pose a line, its seven numbers in `order`."""
    lines = [head]
    for stamp, T in zip(walk.stamps.tolist(), walk.T_world_body, strict=True):
        fields = pose_fields(T)
        lines.append(between.join([stamp_text(stamp), *(fields[k] for k in order)]) + end + "\n")
    path.write_text("".join(lines))
    return path


def in_seconds(stamp: int) -> str:
    return f"{stamp // 10**9}.{stamp % 10**9:09d}"


def assert_same(read: Trajectory, walk: Trajectory) -> None:
    np.testing.assert_allclose(read.stamps, walk.stamps, atol=1000)
    np.testing.assert_allclose(read.T_world_body, walk.T_world_body, atol=1e-7)


@pytest.mark.parametrize(
    ("unit", "stamp_text"),
    [
        ("nanoseconds", str),
        ("nanoseconds", lambda stamp: f"{stamp}.000000"),  # as ORB-SLAM3 writes EuRoC's sequences
        ("nanoseconds", lambda stamp: f"{stamp:.18e}"),  # as numpy writes a column of an array
        ("microseconds", lambda stamp: str(stamp // 1000)),
        ("milliseconds", lambda stamp: f"{stamp / 1e6:.3f}"),
        ("", in_seconds),
    ],
)
def test_stamps_since_1970_in_finer_units_are_known_by_their_digits(tmp_path, caplog, walk, unit, stamp_text):
    caplog.set_level(logging.INFO)
    assert_same(odom.read_tum(written(tmp_path / "t.txt", walk, stamp_text)), walk)
    assert [f"taken for {unit}" in record.message for record in caplog.records] == ([True] if unit else [])


def test_a_stamp_that_is_a_time_in_no_unit_is_refused_with_its_line(tmp_path, walk):
    path = written(tmp_path / "t.txt", walk, lambda stamp: f"{stamp}000")
    with pytest.raises(odom.SourceError, match=r"t\.txt:1: .* since 1970"):
        read_tum(path)


EUROC = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []"
EUROC_MORE = ", v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], b_a_RS_S_x [m s^-2]"
ROSTOPIC = "%time,field.header.frame_id,field.header.stamp," + ",".join(
    [f"field.pose.pose.position.{axis}" for axis in "xyz"]
    + [f"field.pose.pose.orientation.{axis}" for axis in "xyzw"]
    + ["field.pose.covariance0", "field.twist.twist.linear.x"]
)
W_FIRST = [0, 1, 2, 6, 3, 4, 5]


@pytest.mark.parametrize(
    ("head", "stamp_text", "order", "between", "end"),
    [
        (EUROC, str, W_FIRST, ",", ""),
        (EUROC + EUROC_MORE, str, W_FIRST, ",", ",.1,.2,.3,.4,.5"),
        ("timestamp,tx,ty,tz,qx,qy,qz,qw", in_seconds, range(7), ",", ""),
        ("timestamp,qw,qx,qy,qz,x,y,z", in_seconds, [6, 3, 4, 5, 0, 1, 2], ",", ""),
        ("t;pos_x;pos_y;pos_z;quat_x;quat_y;quat_z;quat_w", in_seconds, range(7), ";", ""),
        ("# timestamp(s) tx ty tz qx qy qz qw Pr11 Pr12", in_seconds, range(7), " ", " .1 .2"),
        (ROSTOPIC, lambda stamp: f"{stamp + 5_000_000},my camera,{stamp}", range(7), ",", ",.1,.2"),
    ],
)
def test_a_table_is_read_by_the_names_of_its_columns(tmp_path, walk, head, stamp_text, order, between, end):
    assert_same(read_tum(written(tmp_path / "t.csv", walk, stamp_text, order, between, head + "\n", end)), walk)


def test_nanoseconds_by_name_may_count_from_a_clock_of_their_own(tmp_path, walk):
    early = walk.delayed(-START_S)
    assert_same(read_tum(written(tmp_path / "t.csv", early, str, W_FIRST, ",", EUROC + "\n")), early)


@pytest.mark.parametrize(
    ("head", "words"),
    [
        ("time,x,y,z,roll,pitch,yaw", "none for qx qy qz qw"),
        ("time,x,y,z,qx,qy,qz,qw,x", "several for x"),
        ("Frame,Time", "not a pose"),
    ],
)
def test_names_without_a_pose_are_refused_with_what_is_missing(tmp_path, head, words):
    (tmp_path / "t.csv").write_text(f"{head}\n1,2,3,4,5,6,7\n")
    with pytest.raises(odom.SourceError, match=words):
        read_tum(tmp_path / "t.csv")


def test_truth_in_csv_is_motives_only_where_it_looks_so(tmp_path, walk):
    path = written(tmp_path / "truth.csv", walk, str, W_FIRST, ",", EUROC + EUROC_MORE + "\n", ",.1,.2,.3,.4,.5")
    read, is_foreign = read_truth(path, times=None, topic=None, body=None, y_up=True, of_run=False)
    assert_same(read, walk)
    assert not is_foreign


@given(rows=st.lists(st.lists(st.sampled_from(["1", "-2.5", "1e99", "nan", "sNaN", "", "x", "#"]), max_size=9)))
def test_rows_below_names_are_read_or_refused_with_the_projects_error(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("fuzz") / "t.csv"
    path.write_text("\n".join([EUROC, *map(",".join, rows)]))
    with contextlib.suppress(odom.SourceError):
        read_tum(path)


@pytest.mark.parametrize("lost", ["nan nan nan nan nan nan nan", "0 0 0 0 0 0 0", "1 2 3 inf 0 0 0"])
def test_what_a_tool_writes_where_it_was_lost_is_left_out_and_counted(tmp_path, caplog, walk, lost):
    lines = written(tmp_path / "t.txt", walk, in_seconds).read_text().splitlines()
    for k in (0, 7, 8):
        lines[k] = f"{lines[k].split()[0]} {lost}"
    (tmp_path / "t.txt").write_text("\n".join(lines))
    assert_same(read_tum(tmp_path / "t.txt"), walk.take(~np.isin(np.arange(len(walk)), (0, 7, 8))))
    assert f"3 of {len(walk)} poses are left out, as lost" in caplog.text


def test_lost_poses_of_kitti_are_left_out(tmp_path, walk):
    rows = walk.T_world_body[:, :3].reshape(-1, 12).copy()
    rows[3] = np.nan
    np.savetxt(tmp_path / "poses.txt", rows)
    (tmp_path / "times.txt").write_text("\n".join(map(in_seconds, walk.stamps.tolist())))
    read = read_kitti(tmp_path / "poses.txt", tmp_path / "times.txt")
    assert_same(read, walk.take(np.arange(len(walk)) != 3))


def test_stamps_that_were_rounded_to_few_digits_are_told(tmp_path, caplog, walk):
    read = read_tum(written(tmp_path / "t.txt", walk, lambda stamp: f"{stamp * 1e-9:.6e}"))
    assert len(read) == 1
    assert f"{len(walk) - 1} of {len(walk)} poses are left out" in caplog.text
    assert "digits" in caplog.text


def test_a_quaternion_that_is_none_is_named(tmp_path, walk):
    path = written(tmp_path / "t.txt", walk, in_seconds)
    path.write_text(path.read_text() + "1700000009 1 2 3 0 0 0 3\n")
    with pytest.raises(odom.SourceError, match="1 2 3 0 0 0 3 is no pose"):
        read_tum(path)


def test_a_last_line_cut_short_by_a_crash_is_left_out(tmp_path, caplog, walk):
    path = written(tmp_path / "t.txt", walk, in_seconds)
    path.write_text(path.read_text()[:-40])
    assert_same(read_tum(path), walk.take(np.arange(len(walk)) < len(walk) - 1))
    assert "cut short" in caplog.text


def evaluated(*arguments: str | Path) -> Result:
    """What `odom eval ARGUMENTS` did, in this process."""
    with process_as_it_was():
        return CliRunner().invoke(app, ["eval", *map(str, arguments)])


@pytest.mark.parametrize(("of_estimate", "whose"), [(W_FIRST, "the estimate"), (range(7), None)])
def test_an_estimate_whose_quaternions_begin_with_w_is_told(tmp_path, walk, of_estimate, whose):
    estimate = written(tmp_path / "estimate.txt", walk, in_seconds, of_estimate)
    done = evaluated(estimate, written(tmp_path / "truth.txt", walk, in_seconds))
    assert done.exit_code == 0
    assert [line.split("'s")[0] for line in done.output.splitlines() if "w x y z" in line] == (
        [f"note: {whose}"] if whose else []
    )


OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
MIRROR = np.diag([1.0, -1.0, 1.0, 1.0])
MILLIMETRES = np.array([[1.0] * 3 + [1e3]] * 3 + [[1.0] * 4])
CAMERA_LINK = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])  # its axes in the optical frame


CONVENTIONS = ("T_camera_world", "OpenGL", "camera_link", "millimetres", "left-handed")


def rewritten(walk: Trajectory, convention: str) -> Trajectory:
    T = walk.T_world_body
    poses = {
        "as is": T,
        "T_camera_world": se3.inverses(T),
        "OpenGL": T @ OPENGL,
        "camera_link": T @ CAMERA_LINK,
        "millimetres": T * MILLIMETRES,
        "left-handed": MIRROR @ T @ MIRROR,
    }
    return replace(walk, T_world_body=poses[convention])


@pytest.mark.parametrize("is_estimate", [True, False], ids=["estimate", "truth"])
@pytest.mark.parametrize("convention", ["as is", *CONVENTIONS])
def test_poses_of_another_frame_are_told(tmp_path, walk, convention, is_estimate):
    files = [written(tmp_path / f"{k}.txt", walk if k else rewritten(walk, convention), in_seconds) for k in (0, 1)]
    done = evaluated(*(files if is_estimate else reversed(files)))
    assert done.exit_code == 0
    told = [name for name in (*CONVENTIONS, "w x y z") if name in done.output]
    assert told == ([] if convention == "as is" else [convention]), done.output


def test_figures_that_cannot_be_had_are_null_in_the_file_and_not_a_word_that_is_no_json(tmp_path, walk):
    few = written(tmp_path / "few.txt", walk.take(np.arange(len(walk)) < 4), in_seconds)
    done = evaluated(few, written(tmp_path / "truth.txt", walk, in_seconds), "--json", tmp_path / "new" / "f.json")
    assert done.exit_code == 0, done.exception
    figures = json.loads((tmp_path / "new" / "f.json").read_text(), parse_constant=pytest.fail)
    assert figures["rpe_1s_m"] is None
    assert figures["matched"] == 4


@pytest.mark.parametrize(("option", "name"), [("--json", "figures.json"), ("--plot", "picture.png")])
def test_on_a_full_disk_the_file_of_figures_is_named_with_what_to_do(tmp_path, walk, option, name):
    files = [written(tmp_path / f"{k}.txt", walk, in_seconds) for k in range(2)]
    with room_for(100):
        done = evaluated(*files, option, tmp_path / name)
    assert isinstance(done.exception, OdomError)
    assert str(done.exception).startswith(f"{tmp_path / name} cannot be written: ")


@pytest.mark.parametrize(
    "arguments",
    [
        ["--plot", "picture.xyz"],
        ["--plot", "."],
        ["--json", "."],
        ["--time-offset", "nan"],
        ["--time-offset", "1e30"],
        ["--hand-eye", "nan 0 0 0 0 0 1"],
        ["--hand-eye", "0 0 0 0 0 0 inf"],
        ["--max-gap", "-1"],
        ["--max-gap", "nan"],
        ["--search", "-1"],
        ["--search", "nan"],
    ],
)
def test_options_that_mean_nothing_are_refused_by_their_name(tmp_path, walk, arguments):
    truth = written(tmp_path / "truth.txt", walk, in_seconds)
    assert arguments[0] in refusal("eval", truth, truth, "--mocap", *arguments)
