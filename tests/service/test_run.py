"""`odom run` as its users meet it: real processes, real signals, real files."""

import json
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest
from mcap.reader import make_reader

from odom.evaluation.files import read_tum

Start = Callable[..., "subprocess.Popen[str]"]
Eventually = Callable[..., None]

REPORT_FIELDS = {
    "frames",
    "tracked",
    "completeness",
    "segments",
    "keyframes",
    "loop_closures",
    "loop_candidates",
    "processing_ms",
    "latency_ms",
    "cpu_ms_per_frame",
    "wall_s",
    "fps",
    "peak_rss_mb",
    "lost_frames",
    "unmatched_frames",
}
TRUTH_FIELDS = {
    "ate_m",
    "ate_online_m",
    "rpe_frame_m",
    "rpe_frame_deg",
    "rpe_1s_m",
    "rpe_1s_deg",
    "nees_mean",
    "nees_inside_95",
    "matched",
    "total",
    "time_offset_s",
    "hand_eye",
}
ROLES = {"sensor": "sensor", "odometry": "serve", "recorder": "record", "viewer": "view"}


RECORDING = Path(__file__).parents[2] / "recordings" / "arena.mcap"
ENDLESS = (RECORDING, "--sensor-option=--loop")


@pytest.fixture(params=["arena", "desk"])
def source(request: pytest.FixtureRequest) -> tuple[Path, str]:
    """The recording of this repository, and the first seconds of a real Kinect at a desk."""
    if request.param == "arena":
        return RECORDING, "--end=12"
    shared_data: Path = request.getfixturevalue("shared_data")
    return shared_data / "tum_fr1_xyz", "--end=4"


def lines(path: Path) -> int:
    return len(path.read_text().splitlines()) if path.exists() else 0


def child(run: "subprocess.Popen[str]", role: str) -> psutil.Process | None:
    """The child process of `odom run` with this role, once it is there."""
    for process in psutil.Process(run.pid).children():
        try:
            if ROLES[role] in process.cmdline()[3:4]:
                return process
        except psutil.NoSuchProcess:
            continue
    return None


def test_a_run_leaves_the_files_and_the_report_of_the_contract(
    odom: Start, source: tuple[Path, str], tmp_path: Path
) -> None:
    run = odom("run", *source, "--headless", "--out", tmp_path / "out", "--chain")
    words, _ = run.communicate(timeout=250)
    assert run.returncode == 0, words
    assert "frames tracked" in words
    out = tmp_path / "out"
    report = json.loads((out / "report.json").read_text())
    assert (REPORT_FIELDS | TRUTH_FIELDS) - report.keys() == set()
    assert report["peak_rss_mb"].keys() >= {"sensor", "odometry"}
    assert report["frames"] == lines(out / "odometry.txt") > 80
    assert report["matched"] > 60
    assert (out / "relative_second.txt").exists()
    for name in ("trajectory.txt", "truth.txt", "relative_step.txt", "chain.txt", "plot.png"):
        assert (out / name).stat().st_size > 0, name


def test_two_runs_of_one_recording_are_equal_to_the_byte(odom: Start, source: tuple[Path, str], tmp_path: Path) -> None:
    for name in ("first", "second"):
        run = odom("run", *source, "--headless", "--out", tmp_path / name)
        words, _ = run.communicate(timeout=250)
        assert run.returncode == 0, words
    for name in ("odometry.txt", "trajectory.txt", "relative_step.txt", "relative_second.txt"):
        assert (tmp_path / "first" / name).read_bytes() == (tmp_path / "second" / name).read_bytes(), name


def test_a_recorded_run_replayed_gives_the_same_trajectory(
    odom: Start, source: tuple[Path, str], tmp_path: Path
) -> None:
    recording = tmp_path / "session.mcap"
    for name, arguments in (("live", [*source, "--record", recording]), ("again", [recording])):
        run = odom("run", *arguments, "--headless", "--out", tmp_path / name)
        words, _ = run.communicate(timeout=250)
        assert run.returncode == 0, words
    for name in ("odometry.txt", "trajectory.txt"):
        assert (tmp_path / "live" / name).read_bytes() == (tmp_path / "again" / name).read_bytes(), name
    with recording.open("rb") as stream:
        recorded = [channel.topic for _, channel, _ in make_reader(stream).iter_messages()]
    assert recorded.count("/cam0/odom") + recorded.count("cam0/odom") == lines(tmp_path / "live" / "odometry.txt")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_cleanly_with_everything_saved(
    odom: Start, eventually: Eventually, tmp_path: Path, number: signal.Signals
) -> None:
    run = odom("run", *ENDLESS, "--headless", "--out", tmp_path)
    eventually(lambda: lines(tmp_path / "odometry.txt") > 30, 120, "poses")
    children = psutil.Process(run.pid).children()
    run.send_signal(number)
    words, _ = run.communicate(timeout=60)
    assert run.returncode == 0, words
    assert not any(process.is_running() for process in children)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["frames"] >= lines(tmp_path / "odometry.txt") > 30
    assert len(read_tum(tmp_path / "trajectory.txt")) > 30


@pytest.mark.parametrize("role", ["sensor", "odometry", "recorder"])
def test_a_killed_child_is_named_at_once_and_the_rest_is_saved(
    odom: Start, eventually: Eventually, tmp_path: Path, role: str
) -> None:
    recording = tmp_path / "session.mcap"
    run = odom("run", *ENDLESS, "--headless", "--record", recording, "--out", tmp_path)
    eventually(lambda: lines(tmp_path / "odometry.txt") > 30, 120, "poses")
    victim = child(run, role)
    assert victim is not None
    victim.kill()
    victim.wait()
    words, _ = run.communicate(timeout=60)
    assert run.returncode == 1
    assert f"the {role} was killed by SIGKILL" in words
    assert len(read_tum(tmp_path / "odometry.txt")) >= 30
    assert (tmp_path / "odometry.txt").read_text().endswith("\n")
    assert (tmp_path / "report.json").exists()
    assert (tmp_path / "trajectory.txt").exists() == (role != "odometry")


def test_a_run_goes_on_without_its_viewer_and_says_so(odom: Start, eventually: Eventually, tmp_path: Path) -> None:
    run = odom("run", RECORDING, "--rrd", "--out", tmp_path)
    eventually(lambda: lines(tmp_path / "odometry.txt") > 10, 120, "poses")
    viewer = child(run, "viewer")
    assert viewer is not None
    viewer.kill()
    words, _ = run.communicate(timeout=120)
    assert run.returncode == 1
    assert "the viewer was killed by SIGKILL; the run goes on" in words
    assert len(read_tum(tmp_path / "trajectory.txt")) == 241


def test_children_do_not_outlive_a_killed_run(odom: Start, eventually: Eventually, tmp_path: Path) -> None:
    run = odom("run", *ENDLESS, "--headless", "--out", tmp_path)
    eventually(lambda: lines(tmp_path / "odometry.txt") > 30, 120, "poses")
    children = psutil.Process(run.pid).children()
    run.kill()
    eventually(lambda: not any(process.is_running() for process in children), 5, "children end with their parent")
    assert len(read_tum(tmp_path / "trajectory.txt")) >= 30


@pytest.mark.parametrize(("name", "content", "status"), [("nothing.mcap", None, 1), ("notes.txt", "words", 2)])
def test_a_source_that_is_none_is_refused_by_name(
    odom: Start, tmp_path: Path, name: str, content: str | None, status: int
) -> None:
    if content is not None:
        (tmp_path / name).write_text(content)
    run = odom("run", tmp_path / name, "--headless", "--out", tmp_path / "out")
    words, _ = run.communicate(timeout=60)
    assert run.returncode == status
    assert name in words
    assert "Traceback" not in words
