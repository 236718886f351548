"""`odom run` as its users meet it: real processes, real signals, real files."""

import json
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest
from mcap.reader import make_reader

from odom import read_recording
from odom.evaluation.files import read_tum
from odom.wire.codec import decode_camera_info
from odom.wire.recording import RecordingReader
from sensors.arena import ArenaOptions

Start = Callable[..., "subprocess.Popen[str]"]
Eventually = Callable[..., None]

REPORT_FIELDS = {
    "frames",
    "tracked",
    "completeness",
    "segments",
    "segments_begun",
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
CHAIN_FIELDS = (
    "ate_m", "rpe_frame_m", "rpe_frame_deg", "rpe_1s_m", "rpe_1s_deg", "nees_frame", "holes", "links",
)  # fmt: skip
CHUNK_S = 0.5
ROLES = {"sensor": "sensor", "odometry": "serve", "recorder": "record", "viewer": "view"}


RECORDING = Path(__file__).parents[2] / "recordings" / "arena.mcap"
ENDLESS = (RECORDING, "--sensor-option=--loop")
SESSION = "session.mcap"
SAME_AGAIN = (
    "odometry.txt", "trajectory.txt", "relative_step.txt", "relative_second.txt", "chain.txt", "chain_closed.txt",
)  # fmt: skip
"""Files of a run that another one of the same images writes to the byte."""


@pytest.fixture(scope="module", params=["arena", "desk"])
def source(request: pytest.FixtureRequest) -> tuple[Path, str]:
    """The recording of this repository, and the first seconds of a real Kinect at a desk."""
    if request.param == "arena":
        return RECORDING, "--end=12"
    shared_data: Path = request.getfixturevalue("shared_data")
    return shared_data / "tum_fr1_xyz", "--end=4"


@pytest.fixture(scope="module")
def ran(compiled: None, source: tuple[Path, str], tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder that a recorded run of the source has left, and what it said; the recording is beside the folder."""
    folder = tmp_path_factory.mktemp("ran")
    words = ["run", *source, "--headless", "--chain", "--record", folder / SESSION, "--out", folder / "out"]
    command = [sys.executable, "-m", "odom", *words]
    run = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=250)
    assert run.returncode == 0, run.stdout
    return folder / "out", run.stdout


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


def test_a_run_leaves_the_files_and_the_report_of_the_contract(ran: tuple[Path, str]) -> None:
    out, words = ran
    assert "frames tracked" in words
    report = json.loads((out / "report.json").read_text())
    assert (REPORT_FIELDS | TRUTH_FIELDS) - report.keys() == set()
    assert report["peak_rss_mb"].keys() >= {"sensor", "odometry"}
    assert report["frames"] == lines(out / "odometry.txt") > 80
    assert report["matched"] > 60
    assert report["chain"].keys() >= {*CHAIN_FIELDS}
    assert report["chain_closed"].keys() >= {"ate_m", "rpe_1s_m", "closures", "refused", "closing"}
    assert lines(out / "chain_closed.txt") == lines(out / "chain.txt") == report["frames"]
    assert report["chain"]["holes"] == 0
    assert report["chain"]["links"] == lines(out / "relative_chain.txt") == report["frames"] - 1
    assert (out / "relative_second.txt").exists()
    for name in ("trajectory.txt", "truth.txt", "relative_step.txt", "chain.txt", "plot.png"):
        assert (out / name).stat().st_size > 0, name


def test_a_run_of_what_a_run_recorded_is_equal_to_it_to_the_byte(
    odom: Start, ran: tuple[Path, str], tmp_path: Path
) -> None:
    out, _ = ran
    recording = out.with_name(SESSION)
    run = odom("run", recording, "--headless", "--out", tmp_path)
    words, _ = run.communicate(timeout=250)
    assert run.returncode == 0, words
    for name in SAME_AGAIN:
        assert (tmp_path / name).read_bytes() == (out / name).read_bytes(), name
    with recording.open("rb") as stream:
        recorded = [channel.topic for _, channel, _ in make_reader(stream).iter_messages()]
    assert recorded.count("/cam0/odom") + recorded.count("cam0/odom") == lines(out / "odometry.txt")


def test_a_run_takes_every_frame_of_its_source(source: tuple[Path, str], ran: tuple[Path, str]) -> None:
    path, end = source
    stamps_of_source = [frame.stamp for frame in read_recording(path, end=float(end.removeprefix("--end=")))]
    assert stamps(ran[0] / "odometry.txt") == stamps_of_source


def test_a_signal_ends_a_run_cleanly_with_everything_saved(odom: Start, eventually: Eventually, tmp_path: Path) -> None:
    run = odom("run", *ENDLESS, "--headless", "--out", tmp_path)
    eventually(lambda: lines(tmp_path / "odometry.txt") > 30, 120, "poses")
    children = psutil.Process(run.pid).children()
    run.send_signal(signal.SIGTERM)
    words, _ = run.communicate(timeout=60)
    assert run.returncode == 0, words
    assert not any(process.is_running() for process in children)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["frames"] >= lines(tmp_path / "odometry.txt") > 30
    assert len(read_tum(tmp_path / "trajectory.txt")) > 30


class Heard:
    """The words of a process, each line with the time at which it was heard."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self.process = process
        self.lines: list[tuple[float, str]] = []
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append((time.monotonic(), line))

    def seconds_until(self, words: str, since: float) -> float:
        """Seconds from `since` until a line with `words` came."""
        found = [at - since for at, line in self.lines if words in line]
        assert found, (words, self.words)
        return found[0]

    def end(self, timeout_s: float) -> int:
        status = self.process.wait(timeout_s)
        self._thread.join(5)
        return status

    @property
    def words(self) -> str:
        return "".join(line for _, line in self.lines)


def stamps(odometry: Path) -> list[int]:
    """The stamps (ns) of the whole lines of a trajectory; every line is whole."""
    text = odometry.read_text()
    rows = [line.split() for line in text.splitlines()]
    assert text.endswith("\n")
    assert all(len(row) == 8 for row in rows)
    return [int(row[0].replace(".", "")) for row in rows]


@pytest.mark.wallclock
@pytest.mark.parametrize("role", ["sensor", "odometry", "recorder", "viewer"])
def test_a_killed_child_is_named_within_two_seconds_and_the_files_miss_next_to_nothing(
    odom: Start, eventually: Eventually, tmp_path: Path, role: str
) -> None:
    recording, poses = tmp_path / "session.mcap", tmp_path / "odometry.txt"
    run = odom("run", *ENDLESS, "--headless", "--rrd", "--record", recording, "--out", tmp_path)
    heard = Heard(run)
    eventually(lambda: lines(poses) > 60 and child(run, "viewer"), 120, "poses, and a viewer of them")
    eventually(lambda: "viewer is here" in heard.words, 60, "the viewer at work")
    safe = stamps(poses)
    time.sleep(CHUNK_S)
    victim = child(run, role)
    assert victim is not None
    killed = time.monotonic()
    victim.kill()
    if role in ("viewer", "recorder"):
        eventually(lambda: "the run goes on" in heard.words, 60, "the run goes on")
        eventually(lambda: lines(poses) > len(safe) + 60, 60, "further poses without it")
        run.send_signal(signal.SIGINT)
    assert heard.end(60) == 1, heard.words
    assert "frames tracked" in heard.words
    took = {"run": heard.seconds_until(f"the {role} was killed by SIGKILL", killed)}
    if role != "odometry":
        took["odometry"] = heard.seconds_until(f"{role} is gone", killed)
    print(f"{role} killed: said after {took} s")
    assert max(took.values()) < 2.0
    assert (tmp_path / "report.json").exists()
    assert (tmp_path / "trajectory.txt").exists() == (role != "odometry")
    written = stamps(poses)
    if role == "recorder":
        recording = tmp_path / "session.mcap.part"
        assert f"odom recover {recording} OUT.mcap" in heard.words
    with recording.open("rb") as stream:
        assert role == "recorder" or make_reader(stream).get_summary() is not None
    recorded = [message.stamp for message in RecordingReader(recording).messages() if message.topic == "cam0/odom"]
    assert json.loads((tmp_path / "report.json").read_text())["failed"] == {role: "was killed by SIGKILL"}
    assert len(set(recorded) - set(written)) <= 1  # published, so in the file
    assert set(safe) <= set(recorded)  # half a second old, so in the recording
    assert recorded == sorted(recorded)


def forbid_writing(process: psutil.Process | None) -> None:
    """From now on no file of the process may grow, as on a full disk."""
    assert process is not None
    process.rlimit(psutil.RLIMIT_FSIZE, (1, process.rlimit(psutil.RLIMIT_FSIZE)[1]))


def test_what_cannot_be_saved_at_the_end_is_a_failure(odom: Start, eventually: Eventually, tmp_path: Path) -> None:
    run = odom("run", *ENDLESS, "--headless", "--record", tmp_path / "session.mcap", "--out", tmp_path)
    eventually(lambda: lines(tmp_path / "odometry.txt") > 30, 120, "poses")
    for role in ("odometry", "recorder"):
        forbid_writing(child(run, role))
    run.send_signal(signal.SIGINT)
    words, _ = run.communicate(timeout=60)
    assert run.returncode == 1, words
    (failure,) = [line for line in words.splitlines() if line.startswith("odom: ")]
    for role in ("odometry", "recorder"):
        assert f"the {role} ended with status 1" in failure


def test_a_recorder_that_dies_before_the_first_frame_costs_no_pose(
    odom: Start, eventually: Eventually, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    run = odom("run", RECORDING, "--end", "2", "--headless", "--record", tmp_path / "new.mcap", "--out", out)
    eventually(lambda: child(run, "recorder"), 60, "the recorder")
    recorder = child(run, "recorder")
    assert recorder is not None
    recorder.kill()
    words, _ = run.communicate(timeout=120)
    assert run.returncode == 1, words
    assert "odom: the recorder was killed by SIGKILL" in words
    assert lines(out / "odometry.txt") == json.loads((out / "report.json").read_text())["tracked"] == 15


def test_a_child_that_hangs_at_its_end_is_a_failure(odom: Start, eventually: Eventually, tmp_path: Path) -> None:
    run = odom("run", *ENDLESS, "--headless", "--out", tmp_path, ODOM_SERVICE__STOP_TIMEOUT_S="1.5")
    eventually(lambda: lines(tmp_path / "odometry.txt") > 30, 120, "poses")
    hanging = child(run, "odometry")
    assert hanging is not None
    hanging.suspend()
    run.send_signal(signal.SIGINT)
    words, _ = run.communicate(timeout=60)
    assert run.returncode == 1, words
    assert "the odometry did not end within 1.5 s and was killed" in words


def test_a_run_without_a_frame_is_a_failure(odom: Start, tmp_path: Path) -> None:
    run = odom("run", RECORDING, "--start", "1000", "--headless", "--out", tmp_path)
    words, _ = run.communicate(timeout=120)
    assert run.returncode == 1, words
    assert "no frame" in words


def test_a_run_stopped_before_its_first_frame_is_a_failure_that_says_so(
    odom: Start, eventually: Eventually, tmp_path: Path
) -> None:
    run = odom("run", *ENDLESS, "--headless", "--out", tmp_path)
    eventually(lambda: child(run, "sensor"), 60, "the last child")
    run.send_signal(signal.SIGINT)
    words, _ = run.communicate(timeout=60)
    assert run.returncode == 1, words
    assert "stopped before the first" in words


@pytest.mark.wallclock
def test_children_do_not_outlive_a_killed_run(odom: Start, eventually: Eventually, tmp_path: Path) -> None:
    run = odom("run", *ENDLESS, "--headless", "--out", tmp_path)
    eventually(lambda: lines(tmp_path / "odometry.txt") > 30, 120, "poses")
    children = psutil.Process(run.pid).children()
    run.kill()
    eventually(lambda: not any(process.is_running() for process in children), 5, "children end with their parent")
    assert len(read_tum(tmp_path / "trajectory.txt")) >= 30


@pytest.mark.long
def test_a_viewer_sees_a_run_by_the_line_that_it_prints(odom: Start, eventually: Eventually, tmp_path: Path) -> None:
    # in real time: at full speed a run leaves its viewer, which gives way to it, half a minute or more to start in
    run = odom("run", *ENDLESS, "--realtime", "--namespace", "left", "--headless", "--out", tmp_path / "out")
    heard = Heard(run)
    eventually(lambda: "to watch it: odom view" in heard.words, 60, "the line")
    watch = heard.words.split("to watch it: odom ")[1].splitlines()[0].split()
    view = odom(*watch, "--headless", "--rrd", tmp_path / "seen.rrd")
    seen = Heard(view)
    eventually(lambda: "showing left" in seen.words, 60, "the viewer at work")
    eventually(lambda: lines(tmp_path / "out" / "odometry.txt") > 30, 120, "poses")
    time.sleep(1.0)
    view.send_signal(signal.SIGINT)
    assert seen.end(120) == 0
    assert re.search(r"[1-9]\d* messages shown", seen.words), seen.words
    run.send_signal(signal.SIGINT)
    assert heard.end(120) == 0, heard.words


@pytest.mark.long
def test_the_arena_simulates_the_sensor_that_a_run_asks_for(odom: Start, tmp_path: Path) -> None:
    record = tmp_path / "second.mcap"
    run = odom("run", "arena", "--sensor", "kinect2", "--seconds", "0.1", "--headless", "--record", record)
    words, _ = run.communicate(timeout=120)
    assert run.returncode == 0, words
    camera = next(m for m in RecordingReader(record).messages() if m.topic == "cam0/color/camera_info")
    assert decode_camera_info(camera) != ArenaOptions.from_texts({}).camera
