"""Trajectories from and to files."""

import contextlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from synthetic import smooth, trajectory

from odom.cli.trajectories import read_estimate
from odom.errors import SourceError
from odom.evaluation.files import read_kitti, read_tum, write_tum
from odom.evaluation.motive import read_motive
from odom.evaluation.relative import read_relative
from odom.frame import from_seconds, seconds_text


@pytest.fixture(scope="module")
def walk():
    return trajectory(smooth(np.random.default_rng(0)), np.arange(0, 3, 0.01))


def assert_same(a, b):
    np.testing.assert_array_equal(a.stamps, b.stamps)
    np.testing.assert_allclose(a.T_world_body, b.T_world_body, atol=1e-8)


def test_tum_text_keeps_every_nanosecond(tmp_path, walk):
    write_tum(tmp_path / "t.txt", walk)
    assert_same(read_tum(tmp_path / "t.txt"), walk)


@pytest.mark.parametrize("numbers", [(0, 1, 2), (3, 0, 3), (-1, 0, 10**17)])
def test_tum_text_keeps_the_segments(tmp_path, walk, numbers):
    apart = replace(walk, segment=np.repeat(numbers, 100))
    write_tum(tmp_path / "t.txt", apart)
    assert_same(read_tum(tmp_path / "t.txt"), apart)
    np.testing.assert_array_equal(read_tum(tmp_path / "t.txt").segment, apart.segment)


def test_tum_text_of_one_segment_holds_poses_alone(tmp_path, walk):
    write_tum(tmp_path / "t.txt", replace(walk, segment=np.zeros(len(walk), int)))
    assert "#" not in (tmp_path / "t.txt").read_text()


@given(stamp=st.integers(-9_000_000_000_000_000_000, 9_000_000_000_000_000_000))
def test_the_text_of_a_stamp_is_exact(stamp):
    assert from_seconds(seconds_text(stamp)) == stamp


def test_tum_accepts_exponents_commas_and_comments_and_sorts(tmp_path):
    text = "# a comment\n1.305031103e+09, 1,2,3, 0,0,0,1\n"
    text += "1305031102.5 1 2 4 0 0 0 1 # late\n\n1305031102.5 9 9 9 0 0 0 1\n"
    (tmp_path / "t.txt").write_text(text)
    read = read_tum(tmp_path / "t.txt")
    assert read.stamps.tolist() == [1305031102500000000, 1305031103000000000]
    assert read.positions[0].tolist() == [1, 2, 4]


def test_kitti_needs_its_times(tmp_path, walk):
    np.savetxt(tmp_path / "poses.txt", walk.T_world_body[:, :3, :].reshape(-1, 12), fmt="%.12g")
    (tmp_path / "times.txt").write_text("".join(f"{s // 10**9}.{s % 10**9:09d}\n" for s in walk.stamps))
    assert_same(read_kitti(tmp_path / "poses.txt", tmp_path / "times.txt"), walk)
    (tmp_path / "times.txt").write_text("1.0\n")
    with pytest.raises(SourceError, match="1 times"):
        read_kitti(tmp_path / "poses.txt", tmp_path / "times.txt")


def motive_csv(path: Path, poses, unit="Millimeters", scale=1000.0, lost=()):
    """Write poses given with z up as Motive does: y up, quaternion before position, markers beside the body."""
    R_yup_zup = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    lines = [
        f"Format Version,1.23,Take Name,t,Export Frame Rate,100.0,Rotation Type,Quaternion,Length Units,{unit},"
        "Coordinate Space,Global",
        "",
        ",Type," + ",".join(["Rigid Body"] * 8 + ["Rigid Body Marker"] * 3),
        ",Name," + ",".join(["rig"] * 8 + ["rig:Marker1"] * 3),
        ",ID," + ",".join(["A1"] * 11),
        ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,Position,Position,Position",
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z",
    ]
    for k, (stamp, T) in enumerate(zip(poses.stamps - poses.stamps[0], poses.T_world_body, strict=True)):
        q = Rotation.from_matrix(R_yup_zup @ T[:3, :3]).as_quat()
        t = R_yup_zup @ T[:3, 3] * scale
        body = [""] * 7 if k in lost else [f"{v:.9f}" for v in (*q, *t)]
        lines.append(",".join([str(k), f"{stamp * 1e-9:.6f}", *body, "0.0001", "1", "2", "3"]))
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize(("unit", "scale"), [("Millimeters", 1000.0), ("Meters", 1.0)])
def test_motive_comes_out_in_metres_with_z_up_and_lost_frames_left_out(tmp_path, walk, unit, scale):
    motive_csv(tmp_path / "m.csv", walk, unit, scale, lost={3, 4})
    read = read_motive(tmp_path / "m.csv")
    kept = [k for k in range(len(walk)) if k not in {3, 4}]
    np.testing.assert_allclose(read.T_world_body, walk.T_world_body[kept], atol=1e-6)
    np.testing.assert_allclose(read.stamps, (walk.stamps - walk.stamps[0])[kept], atol=1000)


def test_motives_format_1_21_is_read_rows_without_labels_and_markers_beside_the_body(shared_data):
    read = read_motive(shared_data / "motive_1.21_sample.csv")
    assert len(read) == 250
    np.testing.assert_allclose(read.positions[0], [0.060002, -0.076611, 0.019150], atol=1e-9)
    assert np.ptp(read.positions, axis=0).max() < 1e-3
    assert np.diff(read.stamps).mean() == pytest.approx(1e9 / 120, rel=1e-3)


def test_motive_rows_without_labels_are_told_by_their_place(tmp_path, walk):
    motive_csv(tmp_path / "m.csv", walk)
    text = (tmp_path / "m.csv").read_text()
    (tmp_path / "old.csv").write_text(text.replace(",Type,", ",,").replace(",Name,", ",,").replace(",ID,", ",,"))
    assert_same(read_motive(tmp_path / "old.csv"), read_motive(tmp_path / "m.csv"))
    (tmp_path / "markers.csv").write_text(text.replace(",Type,", ",,").replace("Rigid Body", "Marker"))
    with pytest.raises(SourceError, match="no row says"):
        read_motive(tmp_path / "markers.csv")


def test_motive_names_the_bodies_when_asked_for_another(tmp_path, walk):
    motive_csv(tmp_path / "m.csv", walk)
    with pytest.raises(SourceError, match="rig"):
        read_motive(tmp_path / "m.csv", body="helmet")


@pytest.mark.parametrize("reader", [read_tum, read_motive, read_relative, lambda p: read_kitti(p, p)])
@given(data=st.one_of(st.binary(max_size=300), st.text("0123456789.,-e# \nFrameTypName", max_size=400).map(str.encode)))
def test_readers_refuse_any_bytes_with_the_projects_error_only(tmp_path_factory, reader, data):
    path = tmp_path_factory.mktemp("fuzz") / "file"
    path.write_bytes(data)
    with contextlib.suppress(SourceError):
        assert (np.diff(getattr(reader(path), "stamps", np.zeros(0))) > 0).all()


def test_the_folder_of_a_run_that_was_stopped_is_refused_with_what_it_holds(tmp_path):
    with pytest.raises(SourceError, match=r"stopped before it was saved.*odometry\.txt"):
        read_estimate(tmp_path, times=None, topic="")
