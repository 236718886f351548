"""The files of a run are what other programs read: TUM text, flushed line by line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from full_disk import room_for

from odom.backend import ChainPose, ClosedChain, Estimate, RelativePose, State, TrajectoryPose
from odom.evaluation.files import read_run, read_tum
from odom.evaluation.relative import read_relative
from odom.frame import Stamp
from odom.geometry import se3
from odom.service.previous_results import set_aside
from odom.service.result_files import RunFiles

STEP = np.array([0.01, -0.02, 0.03, 0.001, 0.002, -0.003])
COVARIANCE = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) * 1e-6


def stamp(i: int) -> Stamp:
    return Stamp(1_305_031_102_175_304_001 + i * 33_333_333)


def estimate(i: int, state: State = State.TRACKING, hole: str = "") -> Estimate:
    lost = state is State.LOST
    relative = RelativePose(stamp(i - 1), se3.exp(STEP), COVARIANCE) if i else None
    return Estimate(
        sequence=i,
        stamp=stamp(i),
        state=state,
        reason="",
        segment=0,
        T_odom_camera=None if lost else se3.exp(STEP * i),
        covariance=None if lost else COVARIANCE,
        T_map_odom=np.eye(4),
        inliers=10,
        matches=20,
        step=None if lost else relative,
        pairwise=None if lost or hole else relative,
        chain=None if lost else ChainPose(se3.exp(STEP * i), COVARIANCE, hole),
    )


def test_every_pose_is_on_disk_before_the_next_frame(tmp_path: Path) -> None:
    files = RunFiles(tmp_path)
    for i in range(5):
        files.append(estimate(i))
        assert len((tmp_path / "odometry.txt").read_text().splitlines()) == i + 1
        assert len((tmp_path / "relative_step.txt").read_text().splitlines()) == i


def test_poses_and_covariances_are_read_back_as_written(tmp_path: Path) -> None:
    files = RunFiles(tmp_path)
    for i in range(5):
        files.append(estimate(i))
    written = read_tum(tmp_path / "odometry.txt")
    assert list(written.stamps) == [stamp(i) for i in range(5)]
    np.testing.assert_allclose(written.T_world_body[4], se3.exp(STEP * 4), atol=1e-8)
    relative = read_relative(tmp_path / "relative_step.txt")
    np.testing.assert_allclose(relative.covariances[0], COVARIANCE, rtol=1e-8)
    np.testing.assert_allclose(relative.T_earlier_current[0], se3.exp(STEP), atol=1e-8)


def test_a_lost_frame_leaves_no_pose(tmp_path: Path) -> None:
    files = RunFiles(tmp_path)
    for i, state in enumerate((State.TRACKING, State.LOST, State.RECOVERED)):
        files.append(estimate(i, state))
    assert list(read_tum(tmp_path / "odometry.txt").stamps) == [stamp(0), stamp(2)]


def test_the_largest_joined_part_is_the_trajectory_and_the_others_stand_beside_it(tmp_path: Path) -> None:
    files = RunFiles(tmp_path)
    for segments in ((0, 0, 1, 1, 1, 2), (0, 0, 1, 1, 1, 0)):  # the third part is recognised in the first one later
        poses = [TrajectoryPose(stamp(i), None if i == 3 else np.eye(4), n) for i, n in enumerate(segments)]
        parts = files.write_trajectory(poses)
        assert sum(part["frames"] for part in parts) == 5
        names = {part["file"]: part["frames"] for part in parts}
        assert names == {path.name: len(read_tum(path)) for path in tmp_path.glob("trajectory*.txt")}
        together = read_run(tmp_path)
        assert list(together.stamps) == [stamp(i) for i in range(6) if i != 3]
    assert [(part["segment"], part["frames"]) for part in parts] == [(0, 3), (1, 2)]
    assert not list(tmp_path.glob("*.part"))


def test_a_trajectory_in_one_part_has_no_remark_and_one_without_poses_is_empty(tmp_path: Path) -> None:
    files = RunFiles(tmp_path)
    files.write_trajectory([TrajectoryPose(stamp(0), np.eye(4), 3)])
    assert [line for line in (tmp_path / "trajectory.txt").read_text().splitlines() if "#" in line] == ["# segment 3"]
    assert files.write_trajectory([TrajectoryPose(stamp(0), None, 0)]) == []
    assert (tmp_path / "trajectory.txt").read_text() == ""


def test_a_comment_stands_where_the_causal_poses_are_not_continuous(tmp_path: Path) -> None:
    """A new segment, back in the first one, lost and found there, a new one that is joined to it, and yet another."""
    files = RunFiles(tmp_path)
    lost, segments = (1, 4, 6, 12), (0, 0, 1, 1, 0, 0, 0, 0, 2, 2, 0, 0, 0, 2)
    for i, segment in enumerate(segments):
        state = State.LOST if i in lost else State.TRACKING
        files.append(replace(estimate(i, state), segment=segment))
    text = (tmp_path / "odometry.txt").read_text()
    assert [line for line in text.splitlines() if line.startswith("# segment")] == [
        "# segment 1", "# segment 0", "# segment 0", "# segment 2", "# segment 3",
    ]  # fmt: skip
    assert text.count("# continuity ends") == 5
    read = read_tum(tmp_path / "odometry.txt")
    assert read.segment is not None
    numbers = dict(zip(read.stamps.tolist(), read.segment.tolist(), strict=True))
    assert [numbers.get(stamp(i)) for i in range(14)] == [0, None, 1, 1, None, 0, None, 0, 2, 2, 2, 2, None, 3]


def test_the_chain_has_a_line_for_every_frame_with_a_pose_and_says_its_holes(tmp_path: Path) -> None:
    files = RunFiles(tmp_path)
    for i in range(5):
        files.append(estimate(i, State.LOST if i == 1 else State.TRACKING, "nothing in common" if i == 3 else ""))
    chain = read_tum(tmp_path / "chain.txt")
    assert list(chain.stamps) == [stamp(i) for i in (0, 2, 3, 4)]
    np.testing.assert_allclose(chain.T_world_body[3], se3.exp(4 * STEP), atol=1e-8)
    assert [line for line in (tmp_path / "chain.txt").read_text().splitlines() if line.startswith("#")] == [
        f"# {stamp(3) * 1e-9:.0f}.{stamp(3) % 10**9:09d}: a hole: nothing in common"
    ]
    assert list(read_relative(tmp_path / "relative_chain.txt").stamps_current) == [stamp(2), stamp(4)]


def test_the_closed_chain_is_the_chain_moved_with_the_holes_still_said(tmp_path: Path) -> None:
    files = RunFiles(tmp_path)
    for i in range(5):
        files.append(estimate(i, hole="nothing in common" if i == 3 else ""))
    moved = se3.exp(np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.2]))
    stamps, poses = np.array([stamp(0), stamp(4)]), np.array([np.eye(4), moved])
    closed = ClosedChain(stamps, np.zeros_like(stamps), poses, poses, 1, 0, 1, None)
    files.write_trajectory([TrajectoryPose(stamp(i), np.eye(4), 0) for i in range(5)], closed)
    written = read_tum(tmp_path / "chain_closed.txt")
    assert list(written.stamps) == [stamp(i) for i in range(5)]
    np.testing.assert_allclose(written.T_world_body[4], moved @ se3.exp(4 * STEP), atol=1e-7)
    np.testing.assert_allclose(written.T_world_body[2], closed.moved(stamp(2), se3.exp(2 * STEP)), atol=1e-7)
    assert "a hole: nothing in common" in (tmp_path / "chain_closed.txt").read_text()


def test_the_chain_of_a_recording_played_in_a_loop_is_moved_as_each_round_says(tmp_path: Path) -> None:
    files, there = RunFiles(tmp_path), [0, 1, 2, 0, 1, 2]
    for i in there:
        files.append(estimate(i))
    poses = np.array([se3.exp(k * STEP) for k in (0, 1, 5, 7)])
    ends, rounds = np.array([stamp(0), stamp(2), stamp(0), stamp(2)]), np.array([0, 0, 1, 1])
    closed = ClosedChain(ends, rounds, poses, poses, 1, 0, 1, None)
    files.write_trajectory([TrajectoryPose(stamp(i), np.eye(4), 0) for i in there], closed)
    lines = [line.split() for line in (tmp_path / "chain_closed.txt").read_text().splitlines()]
    moved = [se3.exp((i + k) * STEP)[:3, 3] for i, k in zip(there, (0, 0.5, 1, 5, 6, 7), strict=True)]
    np.testing.assert_allclose([[float(x) for x in line[1:4]] for line in lines], moved, atol=1e-7)


def test_truth_of_the_first_body_is_the_truth(tmp_path: Path) -> None:
    files = RunFiles(tmp_path)
    files.append_truth("camera", stamp(0), np.eye(4))
    files.append_truth("robot", stamp(0), np.eye(4))
    assert len(read_tum(tmp_path / "truth.txt")) == 1
    assert len(read_tum(tmp_path / "truth_robot.txt")) == 1


def test_a_full_disk_leaves_whole_lines_and_writing_goes_on_when_there_is_room_again(tmp_path: Path) -> None:
    files = RunFiles(tmp_path)
    for i in range(10):
        if i in (5, 6):
            with room_for((tmp_path / "odometry.txt").stat().st_size + 40), pytest.raises(OSError, match="too large"):
                files.append(estimate(i))
        else:
            files.append(estimate(i))
    kept = [stamp(i) for i in range(10) if i not in (5, 6)]
    assert list(read_tum(tmp_path / "odometry.txt").stamps) == kept
    assert len(read_relative(tmp_path / "relative_step.txt").covariances) == len(kept) - 1
    chain = read_tum(tmp_path / "chain.txt")
    np.testing.assert_allclose(chain.T_world_body[-1], se3.exp(9 * STEP), atol=1e-8)  # nothing is lost of it


def test_a_trajectory_that_finds_no_room_leaves_the_one_before(tmp_path: Path) -> None:
    files = RunFiles(tmp_path)
    poses = [TrajectoryPose(stamp(i), np.eye(4), 0) for i in range(5)]
    files.write_trajectory(poses[:1])
    with room_for(200), pytest.raises(OSError, match="too large"):
        files.write_trajectory(poses)
    assert len(read_tum(tmp_path / "trajectory.txt")) == 1
    assert not list(tmp_path.glob("*.part"))


def test_truth_of_every_body_of_an_earlier_run_goes_too(tmp_path: Path) -> None:
    (tmp_path / "truth_of_mine.txt").write_text("notes")
    for _ in range(2):
        files = RunFiles(tmp_path)
        assert sorted(path.name for path in tmp_path.glob("truth*")) == ["truth_of_mine.txt"]
        for body in ("camera", "robot"):
            files.append_truth(body, stamp(0), np.eye(4))
    assert (tmp_path / "truth.txt").read_text().count("# body camera") == 1
    assert sorted(path.name for path in tmp_path.glob("until-*/truth*")) == ["truth.txt", "truth_robot.txt"]


@pytest.mark.parametrize("endless", [False, True])
def test_what_a_viewer_beside_it_has_begun_to_write_stays(tmp_path: Path, endless: bool) -> None:
    (tmp_path / "session.rrd").write_bytes(b"begun")
    RunFiles(tmp_path, endless=endless)
    assert (tmp_path / "session.rrd").exists()


def test_starts_that_wrote_nothing_leave_nothing(tmp_path: Path) -> None:
    for _ in range(5):
        RunFiles(tmp_path, endless=True)
    assert not list(tmp_path.glob("until-*"))


def test_a_service_sets_full_files_aside_and_drops_the_oldest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("odom.service.result_files._FULL_BYTES", 20_000)
    monkeypatch.setattr("odom.service.previous_results.MOST_BYTES", 100_000)
    files = RunFiles(tmp_path, endless=True)
    for i in range(1000):
        files.append(estimate(i))
        files.append_truth("robot", stamp(i), np.eye(4))
    parts = sorted({path.parent for path in tmp_path.rglob("odometry.txt")}, key=lambda path: path.stat().st_mtime_ns)
    assert 4 < len(parts) < 8
    assert all((part / "truth.txt").read_text().startswith("# body robot\n") for part in parts)
    size = sum(path.stat().st_size for path in tmp_path.rglob("*.txt"))
    assert size < 100_000 + 2 * 21_000
    stamps = sorted(at for part in parts for at in read_tum(part / "odometry.txt").stamps)
    assert stamps == [stamp(i) for i in range(1000 - len(stamps), 1000)]
    for i in range(1000):  # the camera is off, motion capture is not
        files.append_truth("robot", stamp(1000 + i), np.eye(4))
    assert sum(path.stat().st_size for path in tmp_path.rglob("*.txt")) < 100_000 + 2 * 21_000


@pytest.mark.parametrize("endless", [False, True])
def test_results_of_an_earlier_run_are_set_aside_and_nothing_else_is_touched(tmp_path: Path, endless: bool) -> None:
    for name in ("trajectory.txt", "trajectory-segment-2.txt", "report.json", "odometry.txt", "groundtruth.txt"):
        (tmp_path / name).write_text("old")
    RunFiles(tmp_path, endless=endless).append(estimate(0))
    assert (tmp_path / "groundtruth.txt").read_text() == "old"
    assert not (tmp_path / "report.json").exists()
    assert len((tmp_path / "odometry.txt").read_text().splitlines()) == 1
    aside = {path.name: path.read_text() for path in tmp_path.glob("until-*/*")}
    names = ("odometry.txt", "report.json", "trajectory-segment-2.txt", "trajectory.txt")
    assert aside == dict.fromkeys(names, "old")


def test_a_run_drops_nothing_of_what_was_set_aside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("odom.service.previous_results.MOST_BYTES", 100)
    for i in range(4):
        (tmp_path / "plot.png").write_bytes(bytes([i]) * 200)
        (tmp_path / "session.rrd").write_bytes(b"shown")
        set_aside(tmp_path, shown=True)
    assert sorted(path.read_bytes()[0] for path in tmp_path.glob("until-*/plot.png")) == [0, 1, 2, 3]
    assert len(list(tmp_path.glob("until-*/session.rrd"))) == 4
