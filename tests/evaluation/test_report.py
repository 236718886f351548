"""What a run leaves on disk, judged; and the command that judges any two trajectories."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from sheets import sheets_drawn
from synthetic import T_BODY_CAMERA, mocap, odometry, smooth, trajectory

from odom.cli.trajectories import frames_of_run
from odom.errors import InputError
from odom.evaluation import EvaluationOptions, Trajectory, align, evaluate, run_report, trajectory_plot
from odom.evaluation.files import write_tum
from odom.evaluation.judgement import judge
from odom.evaluation.metrics import NEES_BOUND_95
from odom.evaluation.mocap_calibration import CalibrationOptions
from odom.evaluation.run_report import report_with_truth
from odom.frame import Stamp
from odom.geometry import se3
from odom.wire.codec import encode_pose
from odom.wire.recording import RecordingWriter

FIELDS = {
    "ate_m", "ate_online_m", "rpe_frame_m", "rpe_frame_deg", "rpe_1s_m", "rpe_1s_deg", "nees_mean", "nees_inside_95",
    "matched", "total", "time_offset_s", "hand_eye",
}  # fmt: skip
COVARIANCE = np.diag([0.002**2] * 3 + [0.001**2] * 3)


def relative_lines(rng, true, lag):
    """The steps over `lag` frames of a trajectory, with errors of the covariance that they state."""
    steps = se3.inverses(true.T_world_body[:-lag]) @ true.T_world_body[lag:]
    steps = steps @ np.array([se3.exp(e) for e in rng.multivariate_normal(np.zeros(6), COVARIANCE, len(steps))])
    turns = Rotation.from_matrix(steps[:, :3, :3]).as_quat()
    stated = " ".join(f"{v:.9e}" for v in COVARIANCE[np.triu_indices(6)])
    for earlier, current, T, turn in zip(true.stamps[:-lag], true.stamps[lag:], steps, turns, strict=True):
        stamps = " ".join(f"{s // 10**9}.{s % 10**9:09d}" for s in (earlier, current))
        yield f"{stamps} {' '.join(f'{v:.9e}' for v in (*T[:3, 3], *turn))} {stated}\n"


@pytest.fixture(scope="module")
def scene():
    rng = np.random.default_rng(0)
    pose = smooth(rng)
    true = trajectory(pose, np.arange(0, 30, 1 / 30))
    return rng, true, odometry(rng, true), mocap(rng, pose, 31.0, offset_s=0.037)


@pytest.fixture(scope="module")
def written(tmp_path_factory, scene):
    """A folder as a run leaves it: exact truth of the camera, honest covariances."""
    folder = tmp_path_factory.mktemp("written")
    rng, true, estimate, _ = scene
    write_tum(folder / "trajectory.txt", estimate)
    write_tum(folder / "odometry.txt", estimate)
    write_tum(folder / "truth.txt", true)
    for name, lag in (("relative_step.txt", 1), ("relative_second.txt", 30)):
        (folder / name).write_text("".join(relative_lines(rng, true, lag)))
    return folder


@pytest.fixture
def run(tmp_path, written):
    """The folder, a test's own."""
    return Path(shutil.copytree(written, tmp_path, dirs_exist_ok=True))


@pytest.fixture
def unplotted(monkeypatch):
    """Nothing is drawn: the picture is another test's."""
    monkeypatch.setattr(run_report, "plot", lambda *_, **__: None)


def test_the_fields_of_the_contract_are_all_there_and_a_plot(run):
    report = report_with_truth(run, total_frames=1000)
    assert set(report) >= FIELDS
    assert json.loads(json.dumps(report)) == report
    assert (report["matched"], report["total"]) == (900, 1000)
    assert report["nees_mean"] == pytest.approx(6, abs=0.5)
    assert report["nees_inside_95"] == pytest.approx(0.95, abs=0.03)
    assert report["time_offset_s"] is None
    picture = cv2.imread(str(run / "plot.png"))
    assert picture.shape[1] > 1500
    assert len(np.unique(picture @ (1, 256, 256**2))) > 200


def test_errors_of_an_estimate_that_began_later_are_drawn_at_their_time(scene):
    _, true, estimate, _ = scene
    later = evaluate(estimate.take(np.arange(450, 900)), true)
    axis = Figure().add_subplot()
    trajectory_plot._draw_error(axis, int(estimate.stamps[0]), evaluate(estimate, true), later)
    starts = {line.get_label().split(",")[0]: line.get_xdata()[0] for line in axis.get_lines()}
    assert starts == {"corrected": 0.0, "online": pytest.approx(15.0)}


def test_time_counts_from_the_first_pose_of_the_run_in_all_panels(run, scene, monkeypatch):
    """The part that is judged is the longest: one before it is in the motions over a second alone."""
    drawn = sheets_drawn(monkeypatch)
    lines = (run / "trajectory.txt").read_text().splitlines(keepends=True)
    (run / "trajectory.txt").write_text("".join(["# segment 0\n", *lines[:300], "# segment 1\n", *lines[300:]]))
    report_with_truth(run)
    begins = {
        panel.get_title(loc="left"): min(float(np.nanmin(line.get_xdata())) for line in panel.get_lines())
        for panel in drawn[0].axes
        if panel.get_xlabel() == "time, s"
    }
    assert begins == {
        "Distance from truth after alignment": pytest.approx(9.0, abs=0.1),
        "Drift over one second against the claimed 3 sigma": 0.0,
    }


def test_the_largest_errors_are_in_the_histogram_and_below_the_legend(scene, monkeypatch):
    _, true, estimate, _ = scene
    off = estimate.T_world_body.copy()
    off[400, 0, 3] += 1.0
    report, axis, counts = evaluate(Trajectory(estimate.stamps, off), true), Figure().add_subplot(), []
    draw = axis.hist
    monkeypatch.setattr(axis, "hist", lambda *given, **named: counts.append(draw(*given, **named)[0]))
    trajectory_plot._draw_histogram(axis, report, report)
    assert [count.sum() for count in counts] == [900, 900]
    axis = Figure().add_subplot()
    trajectory_plot._draw_error(axis, int(estimate.stamps[0]), report, None)
    assert axis.get_ylim()[1] > 1.2e3 * report.errors_m.max()


def test_a_plot_that_cannot_be_written_costs_no_figure_and_is_counted(run):
    (run / "plot.png").mkdir()
    report = report_with_truth(run)
    assert report["ate_m"] is not None
    assert report["nees_mean"] is not None
    assert report["unwritten"] == 1
    assert "plot.png" in report["truth_notes"][-1]


@pytest.mark.usefixtures("unplotted")
def test_truth_of_a_marker_body_is_calibrated_by_the_name_in_its_file(run, scene):
    write_tum(run / "truth.txt", scene[3])
    text = (run / "truth.txt").read_text()
    (run / "truth.txt").write_text("# body rig\n" + text)
    report = report_with_truth(run)
    assert report["time_offset_s"] == pytest.approx(0.037, abs=0.002)
    assert report["hand_eye"]["parent"] == "rig"
    np.testing.assert_allclose(report["hand_eye"]["translation_m"], T_BODY_CAMERA[:3, 3], atol=0.005)


def test_truth_of_another_time_gives_nulls_and_says_why(run, scene):
    write_tum(run / "truth.txt", scene[1].delayed(5000.0))
    report = report_with_truth(run)
    assert report["ate_m"] is None
    assert report["matched"] == 0
    assert "clock" in report["truth_notes"][0]


@pytest.mark.parametrize(("poses", "words"), [(1, "only 1 pose:"), (2, "only 2 poses:")])
def test_an_estimate_of_too_few_poses_is_not_told_to_check_its_clock(scene, poses, words):
    _, true, estimate, _ = scene
    with pytest.raises(InputError, match=words) as refused:
        evaluate(estimate.take(np.arange(poses)), true)
    assert "clock" not in str(refused.value)
    with pytest.raises(InputError, match=words):
        evaluate(estimate.take(np.arange(poses)), true.take(true.stamps >= estimate.stamps[poses - 1]))


def rewritten(path: Path, columns: list[int]) -> None:
    """Write a TUM file with its columns in another order."""
    lines = [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]
    path.write_text("".join(" ".join(words[k] for k in columns) + "\n" for words in lines))


@pytest.mark.usefixtures("unplotted")
@pytest.mark.parametrize("body", ["camera", "rig"])
def test_truth_whose_quaternions_begin_with_w_is_told(run, scene, body):
    if body != "camera":
        write_tum(run / "truth.txt", scene[3])
    head = f"# body {body}\n"
    (run / "truth.txt").write_text(head + (run / "truth.txt").read_text())
    assert not any("w x y z" in note for note in report_with_truth(run)["truth_notes"])
    rewritten(run / "truth.txt", [0, 1, 2, 3, 7, 4, 5, 6])
    (run / "truth.txt").write_text(head + (run / "truth.txt").read_text())
    assert "written w x y z" in " ".join(report_with_truth(run)["truth_notes"])


@pytest.mark.usefixtures("unplotted")
@pytest.mark.parametrize(
    ("signs", "unit", "told", "remedy"),
    [([1, 1, 1], 1e3, "in millimetres", "divide"), ([1, -1, 1], 1.0, "left-handed", "signs of y, qx and qz")],
)
def test_motion_capture_in_millimetres_or_with_left_handed_axes_is_told(run, scene, signs, unit, told, remedy):
    T = scene[3].T_world_body * np.outer([*signs, 1], [*signs, 1])
    T[:, :3, 3] *= unit
    write_tum(run / "truth.txt", replace(scene[3], T_world_body=T))
    (run / "truth.txt").write_text("# body rig\n" + (run / "truth.txt").read_text())
    first = report_with_truth(run)["truth_notes"][0]
    assert told in first
    assert remedy in first


def test_a_gap_in_truth_is_not_interpolated_over(scene):
    _, true, estimate, _ = scene
    kept = np.ones(len(true), dtype=bool)
    kept[300:400] = False
    report = evaluate(estimate, true.take(kept))
    assert (report.matched, report.total) == (800, 900)
    assert any("only 800 of 900" in note for note in report.notes)


def test_a_step_over_a_hole_is_not_one_of_a_frame(scene):
    _, true, estimate, _ = scene
    first, second = np.arange(300), np.arange(390, 900)
    poses = estimate.T_world_body.copy()
    poses[second, 0, 3] += 0.1
    apart = Trajectory(estimate.stamps, poses).take(np.concatenate([first, second]))
    found = evaluate(apart, true).rpe_frame
    halves = [evaluate(estimate.take(half), true).rpe_frame for half in (first, second)]
    assert found.pairs == sum(half.pairs for half in halves) == 299 + 509
    for name in ("rmse_m", "rmse_deg"):
        mean = sum(half.pairs * getattr(half, name) ** 2 for half in halves) / found.pairs
        assert getattr(found, name) == pytest.approx(np.sqrt(mean), rel=1e-9)


def test_segments_that_were_never_joined_are_not_glued(scene):
    _, true, estimate, _ = scene
    late = estimate.moved(se3.exp(np.array([5.0, 0, 0, 0, 0, 1.0])))
    late_part = np.arange(len(estimate)) >= 600
    poses = np.where(late_part[:, None, None], late.T_world_body, estimate.T_world_body)
    split = Trajectory(estimate.stamps, poses, late_part.astype(np.int64))
    report = evaluate(split, true)
    assert report.matched == 600
    assert report.ate_m == pytest.approx(evaluate(estimate.take(~late_part), true).ate_m)
    assert any("never joined" in note for note in report.notes)


def test_truth_in_segments_that_were_never_joined_is_not_taken_for_one_world(scene):
    _, true, estimate, body = scene
    options = EvaluationOptions()
    for truth, to_calibrate in ((true, None), (body, CalibrationOptions())):
        early = np.arange(len(truth)) < 2 * len(truth) // 3
        apart = truth.moved(se3.exp(np.array([5.0, 0, 0, 0, 0, 1.0]))).T_world_body
        poses = np.where(early[:, None, None], truth.T_world_body, apart)
        split = Trajectory(truth.stamps, poses, (~early).astype(np.int64))
        found = judge(estimate, split, options, to_calibrate)
        best = judge(estimate, truth.take(early), options, to_calibrate)
        assert found.report.ate_m == pytest.approx(best.report.ate_m)
        assert sum("the truth has 2 segments" in note for note in found.notes) == 1


@pytest.mark.usefixtures("unplotted")
def test_the_online_trajectory_is_judged_in_the_segment_that_the_final_one_is(run, scene):
    _, true, estimate, _ = scene
    late = np.arange(len(estimate)) >= 600
    poses = estimate.T_world_body.copy()
    poses[late, 0, 3] += 5.0
    write_tum(run / "odometry.txt", Trajectory(estimate.stamps, poses))
    joined = report_with_truth(run)["ate_online_m"]
    lines = (run / "trajectory.txt").read_text().splitlines()
    segments = ["# segment 0", *lines[:600], "# segment 1", *lines[600:]]
    (run / "trajectory.txt").write_text("\n".join(segments) + "\n")
    cut = report_with_truth(run)
    assert cut["ate_online_m"] == cut["ate_m"] == pytest.approx(evaluate(estimate.take(~late), true).ate_m, rel=1e-6)
    assert joined > 0.1


def test_an_alignment_that_positions_cannot_settle_is_said():
    t = np.linspace(0, 1, 100)[:, None]
    line = t * np.array([1.0, 2.0, 0.5])
    assert "straight line" in align(line, line).notes[0]
    assert "spread only" in align(line * 1e-4, line * 1e-4).notes[0]
    with pytest.raises(InputError, match="3 at least"):
        align(line[:2], line[:2])


def test_evaluation_is_the_same_in_every_world_and_knows_no_scale(scene):
    _, true, estimate, _ = scene
    moved = evaluate(estimate.moved(se3.exp(np.array([9.0, -4, 2, 1, 2, -1]))), true)
    assert moved.ate_m == pytest.approx(evaluate(estimate, true).ate_m, rel=1e-9)
    double = true.T_world_body.copy()
    double[:, :3, 3] *= 2
    assert evaluate(Trajectory(true.stamps, double), true).ate_m > 0.1


def odom(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "odom", *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False
    )


def test_the_command_judges_a_run_and_writes_what_it_is_asked_for(run, tmp_path):
    out = tmp_path / "figures.json"
    done = odom("eval", run, "--relative", run / "relative_second.txt", "--json", out, "--plot", tmp_path / "p.png")
    assert done.returncode == 0, done.stderr
    assert "matched        900 / 900" in done.stdout
    assert json.loads(out.read_text())["matched"] == 900
    assert (tmp_path / "p.png").is_file()


def test_the_command_counts_the_frames_of_a_run_as_its_report_does(run):
    lines = (run / "trajectory.txt").read_text().splitlines(keepends=True)
    (run / "trajectory.txt").write_text("".join(lines[:400]))
    for report in ({"frames": 900, "tracked": 400}, {"frames": 800, "total": 900}):
        (run / "report.json").write_text(json.dumps(report))
        done = odom("eval", run)
        assert "matched        400 / 900" in done.stdout
        assert "only 400 of 900 frames" in done.stdout
    for broken in ("", "[]", "{}", '{"frames": null}'):
        (run / "report.json").write_text(broken)
        assert frames_of_run(run) is None


def test_the_command_writes_nees_as_the_runs_report_does(run, scene, tmp_path):
    """Of a truth whose own noise shows: `mean` allows for it, as `nees_mean` does."""
    rng, true, _, _ = scene
    stamps = np.arange(true.stamps[0], true.stamps[-1], 8_333_333)
    noisy, _ = true.at(stamps, 0.1)
    noisy[:, :3, 3] += rng.normal(0.0, 0.002, (len(noisy), 3))
    write_tum(run / "truth.txt", Trajectory(stamps, noisy))
    expected = report_with_truth(run)
    done = odom("eval", run, "--relative", run / "relative_second.txt", "--json", tmp_path / "figures.json")
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "figures.json").read_text())["nees_relative_second"]
    assert expected["nees_mean"] < 0.9 * expected["nees_mean_exact_truth"]
    assert found == pytest.approx({name: expected[f"nees_{name}"] for name in found})
    assert len(found) == 4


def test_relative_poses_of_one_name_in_two_folders_are_both_written(run, tmp_path):
    paths = []
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        paths.append(shutil.copy(run / "relative_second.txt", tmp_path / name / "relative_second.txt"))
    out = tmp_path / "figures.json"
    done = odom("eval", run, "--relative", paths[0], "--relative", paths[1], "--json", out)
    assert done.returncode == 0, done.stderr
    figures = json.loads(out.read_text())
    assert figures["nees_relative_second"] == figures[f"nees_{paths[1]}"]


def test_the_command_imposes_what_is_known_of_mocap(run, scene, tmp_path):
    write_tum(tmp_path / "mocap.txt", scene[3])
    pose = [*T_BODY_CAMERA[:3, 3], *Rotation.from_matrix(T_BODY_CAMERA[:3, :3]).as_quat()]
    known = " ".join(f"{value:.9f}" for value in pose)
    imposed = odom(
        "eval", run / "trajectory.txt", tmp_path / "mocap.txt", "--time-offset", "0.037", "--hand-eye", known
    )
    assert imposed.returncode == 0, imposed.stderr
    assert "+0.0370 ± 0.0000 s (imposed)" in imposed.stdout


def test_the_command_takes_the_truth_file_of_a_run_for_the_body_that_it_names(run, scene):
    write_tum(run / "truth.txt", scene[3])
    (run / "truth.txt").write_text("# body rig\n" + (run / "truth.txt").read_text())
    by_folder, by_file = odom("eval", run), odom("eval", run / "trajectory.txt", run / "truth.txt")
    assert "hand-eye" in by_file.stdout
    assert by_file.stdout == by_folder.stdout


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (["nowhere.txt", "nowhere.txt"], 2),
        (["words.txt", "words.txt"], 1),
        ([], 2),
        (["words.txt", "--time-offset", "soon"], 1),
    ],
)
def test_the_command_fails_with_the_contracts_status(tmp_path, monkeypatch, arguments, status):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "words.txt").write_text("no poses\n")
    assert odom("eval", *arguments).returncode == status


@pytest.mark.parametrize("name", ["take_0.db3", "take.bag"])
def test_a_single_file_of_a_bag_that_cannot_be_read_is_named(tmp_path, name):
    (tmp_path / name).write_bytes(b"SQLite format 3\0")
    done = odom("eval", tmp_path / name, tmp_path / name)
    assert done.returncode == 1
    assert name in done.stderr
    assert "bag that can be read" in done.stderr


def test_a_recording_with_truth_inside_is_judged_by_it(tmp_path, scene):
    _, true, estimate, _ = scene
    with RecordingWriter(tmp_path / "session.mcap") as writer:
        for key, trajectory in (("cam0/pose", estimate), ("truth/camera/pose", true)):
            for stamp, T in zip(trajectory.stamps, trajectory.T_world_body, strict=True):
                writer.write(encode_pose(key, Stamp(int(stamp)), T, "map"))
    done = odom("eval", tmp_path / "session.mcap")
    assert done.returncode == 0, done.stderr
    assert f"matched        {len(estimate)} / {len(estimate)}" in done.stdout


def test_total_counts_frames_without_a_pose(scene):
    _, true, estimate, _ = scene
    assert evaluate(estimate, true, EvaluationOptions(total_frames=1234)).total == 1234


def test_the_bound_of_nees_is_the_quantile_that_it_claims_to_be():
    assert pytest.approx(chi2.ppf(0.95, 6), rel=1e-15) == NEES_BOUND_95
