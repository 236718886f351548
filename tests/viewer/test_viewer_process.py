"""`odom view` as a process: files, late joiners, frozen and killed viewers, ports, memory."""

import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import psutil
import pyarrow as pa
import pytest
import zenoh
from made_up_device import true_pose
from refused import refusal
from rerun.chunk import RrdReader
from viewer_processes import Running

from odom.viewer import ViewerSettings
from odom.viewer.viewer_process import _HISTORY_S, Viewer
from odom.wire import Topics, WireSettings
from odom.wire.session import open_session
from odom.wire.settings import ANY_LOCAL_PORT

Start = Callable[..., Running]
SHOWN_BYTES = 2_000_000
"""Of a recording with some 20 frames of the made-up device, each of 100 kB with its images."""


def _loaded(rrd: Path) -> dict[str, list[pa.RecordBatch]]:
    """The chunks of each entity, by Rerun's own reader."""
    chunks: dict[str, list[pa.RecordBatch]] = {}
    for chunk in RrdReader(rrd).stream():
        chunks.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())
    return chunks


def _rows(chunks: list[pa.RecordBatch]) -> int:
    return sum(chunk.num_rows for chunk in chunks)


def _last_line(chunks: list[pa.RecordBatch]) -> np.ndarray:
    """The points of the newest line strips, n x 3."""
    newest = chunks[-1].column("LineStrips3D:strips")[-1].as_py()
    return np.concatenate([np.array(strip) for strip in newest])


def test_a_file_holds_everything_from_the_first_frame_and_ends_by_itself(start: Start, tmp_path: Path) -> None:
    device = start("device", 150, 30)
    view = start("view", "--headless", "--rrd", tmp_path / "session.rrd")
    device.wait_for("ended", 120)
    assert view.process.wait(60) == 0
    shown = _loaded(tmp_path / "session.rrd")
    assert _rows(shown["/world/camera"]) == 150
    assert 2 <= _rows(shown["/world/camera/color"]) <= 152  # and its pinhole; a busy machine thins images
    for path in ("/world/camera/depth", "/world/online", "/world/corrected", "/world/truth/camera", "/log", "/summary"):
        assert path in shown


@pytest.mark.long
def test_a_late_viewer_shows_the_whole_trajectory_and_a_killed_one_comes_back(start: Start, tmp_path: Path) -> None:
    device = start("device", 900, 60, "now")
    device.wait_for("frame 150", 120)
    first = start("view", "--headless", "--rrd", tmp_path / "first.rrd")
    device.wait_for("frame 210", 120)
    first.process.send_signal(signal.SIGKILL)
    second = start("view", "--headless", "--rrd", tmp_path / "second.rrd")
    second.wait_for("showing cam0", 120)
    device.wait_for("ended", 120)
    assert second.stop() == 0
    shown = _loaded(tmp_path / "second.rrd")
    assert _rows(shown.get("/world/camera", [])) < 700  # it really was late
    for path in ("/world/online", "/world/corrected", "/world/truth/camera"):
        line = _last_line(shown[path])
        for end in (0, 899):
            assert np.linalg.norm(line - true_pose(end)[:3, 3], axis=1).min() < 0.12, path
        assert np.linalg.norm(np.diff(line, axis=0), axis=1).max() < 0.2, path


def _clouds(rrd: Path) -> dict[str, int]:
    """The number of points of each key frame's cloud that is there at the end."""
    counts: dict[str, int] = {}
    for path, chunks in _loaded(rrd).items():
        names = {name for chunk in chunks for name in chunk.schema.names}
        if path.startswith("/world/clouds/") and "Clear:is_recursive" not in names:
            batches = [chunk for chunk in chunks if "Points3D:positions" in chunk.schema.names]
            counts[path] = len(batches[-1].column("Points3D:positions")[-1].as_py())
    return counts


def _loops(rrd: Path) -> int:
    """The number of accepted loop closures that are there at the end."""
    return len(_loaded(rrd)["/world/loops/accepted"][-1].column("LineStrips3D:strips")[-1].as_py())


@pytest.mark.wallclock  # a viewer that is not given time drops clouds, as it should
@pytest.mark.parametrize(("every", "kept"), [(15, 28), (2, 105)])
def test_a_late_viewer_has_the_clouds_of_the_same_key_frames_and_the_loops_of_an_early_one(
    start: Start, tmp_path: Path, every: int, kept: int
) -> None:
    """Of 28 key frames all are kept; of 210 every second one, since 161 are too many."""
    device = start("device", 420, 30, "wait", every)
    early = start("view", "--headless", "--rrd", tmp_path / "early.rrd")
    device.wait_for("frame 210", 120)
    late = start("view", "--headless", "--rrd", tmp_path / "late.rrd")
    late.wait_for("showing cam0", 120)
    device.wait_for("ended", 120)
    assert (early.process.wait(60), late.process.wait(60)) == (0, 0)  # by themselves, when they have shown the end
    clouds = _clouds(tmp_path / "early.rrd")
    late_clouds = _clouds(tmp_path / "late.rrd")
    print(len(clouds), "clouds of", sum(clouds.values()), "points; only one has", clouds.keys() ^ late_clouds.keys())
    assert len(clouds) == kept
    assert min(clouds.values()) > 2000
    assert clouds == late_clouds
    assert _loops(tmp_path / "late.rrd") == _loops(tmp_path / "early.rrd") > 2


@pytest.mark.process
def test_a_past_that_is_told_slowly_is_heard_to_its_end(endpoint: str) -> None:
    """On a busy machine a hundred clouds take longer than the viewer waits for the next one."""
    topics, clouds, between_s = Topics("cam0"), 12, 0.25

    def tell(query: zenoh.Query) -> None:
        with query:
            for i in range(clouds):
                time.sleep(between_s)
                query.reply(topics.keyframes, bytes([i]))

    assert clouds * between_s > _HISTORY_S
    with (
        open_session(WireSettings(connect=(), listen=(endpoint,))) as odometry,
        open_session(WireSettings(connect=(endpoint,), listen=(ANY_LOCAL_PORT,))) as session,
    ):
        odometry.zenoh.declare_queryable(topics.keyframes, tell)
        viewer = Viewer(session, topics, ViewerSettings(), MagicMock())
        told = [sample.payload.to_bytes()[0] for sample in viewer._past()]
    assert told == list(range(clouds))


@pytest.mark.wallclock
def test_a_frozen_viewer_holds_nobody_up(start: Start, tmp_path: Path) -> None:
    device = start("device", 600, 60)
    view = start("view", "--web", "--web-port", "0", "--data-port", "0")
    device.wait_for("frame 60", 60)
    view.process.send_signal(signal.SIGSTOP)
    device.wait_for("ended", 40)
    slowest = float(device.wait_for(r"slowest ([\d.]+)", 5))
    view.process.send_signal(signal.SIGCONT)
    print(f"slowest frame published beside a frozen viewer: {1e3 * slowest:.1f} ms")
    assert slowest < 0.25
    assert view.stop() == 0


def test_the_page_is_on_loopback_only_takes_free_ports_and_goes_with_the_viewer(start: Start) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        taken = other.getsockname()[1]
        view = start("view", "--web", "--web-port", taken, "--data-port", taken)
        address = view.wait_for(r"viewer: (http://127\.0\.0\.1:\d+/\?url=rerun%2Bhttp://127\.0\.0\.1:\d+/proxy)", 120)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        try:
            page = urllib.request.urlopen(address, timeout=5).read()
            break
        except OSError:
            time.sleep(0.2)
    assert b"<html" in page
    for process in (family := view.family()):
        for connection in process.net_connections(kind="inet"):
            if connection.status == psutil.CONN_LISTEN:
                assert connection.laddr.ip == "127.0.0.1", (process.cmdline(), connection)
    assert len(family) == 2
    view.process.send_signal(signal.SIGKILL)
    view.process.wait()
    _, alive = psutil.wait_procs(family, timeout=10)
    assert not alive


def test_viewers_that_start_at_the_same_moment_each_get_a_port_of_their_own(start: Start) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        wanted = probe.getsockname()[1]
    views = [start("view", "--web", "--web-port", "0", "--data-port", wanted) for _ in range(3)]
    ports = [view.wait_for(r"url=rerun%2Bhttp://127\.0\.0\.1:(\d+)/proxy", 120) for view in views]
    assert len(set(ports)) == len(views)
    assert str(wanted) in ports
    for view in views:
        view.wait_for("showing cam0", 120)
        assert view.stop() == 0, view.lines[-5:]


def test_ctrl_c_ends_cleanly(start: Start, tmp_path: Path) -> None:
    file = tmp_path / "cut.rrd"
    start("device", 600, 30)
    view = start("view", "--headless", "--rrd", file)
    deadline = time.monotonic() + 120
    while not (file.exists() and file.stat().st_size > SHOWN_BYTES):
        assert time.monotonic() < deadline, view.lines
        time.sleep(0.05)
    view.process.send_signal(signal.SIGINT)
    assert view.process.wait(60) == 0
    assert _rows(_loaded(file)["/world/camera"]) > 10


@pytest.mark.parametrize("arguments", [["--headless"], ["--web", "--headless"], ["--web", "--web-port", "70000"]])
def test_options_that_make_no_sense_are_refused(arguments: list[str]) -> None:
    assert refusal("view", *arguments)


def test_a_file_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    arguments = ["view", "--headless", "--rrd", str(tmp_path / "file" / "x.rrd")]
    done = subprocess.run([sys.executable, "-m", "odom", *arguments], capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert "cannot be written" in done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="the screen that is not there is X11's")
def test_a_window_that_cannot_open_is_said_with_a_way_out(start: Start) -> None:
    view = start("view", "--data-port", "0", DISPLAY=":12345", WAYLAND_DISPLAY="")
    assert view.process.wait(60) == 1
    assert view.said("window ended with status 1: .+; --web"), view.lines
    assert not view.said("Traceback")


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_memory_stays_flat_over_10000_frames(start: Start) -> None:
    """The server's memory is full after a quarter of the run by default: what grows after that would be a leak."""
    device = start("device", 10_000, 60)
    view = start("view", "--web", "--web-port", "0", "--data-port", "0")
    rss: list[float] = []
    while device.said("ended") is None:
        time.sleep(2.0)
        rss.append(sum(process.memory_info().rss for process in view.family()) / 2**20)
    print(f"viewer and server: {max(rss):.0f} MiB at most, {rss[len(rss) // 2]:.0f} half way, {rss[-1]:.0f} at the end")
    assert max(rss) < 1024
    third = len(rss) // 3
    assert max(rss[-third:]) < 1.1 * max(rss[third : 2 * third])
