"""`odom view` as a process: files, late joiners, frozen and killed viewers, ports, memory."""

import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import psutil
import pytest
from conftest import Running

Start = Callable[..., Running]


def _rerun(*arguments: str | Path) -> str:
    package = find_spec("rerun_cli")
    assert package is not None
    assert package.origin is not None
    program = Path(package.origin).with_name("rerun")
    done = subprocess.run([program, *arguments], capture_output=True, text=True, timeout=120, check=True)
    return done.stdout


def _rows(rrd: Path) -> dict[str, int]:
    """Rows a component path of a recording, as Rerun's own reader counts them."""
    rows: dict[str, int] = {}
    for line in _rerun("rrd", "print", "-v", rrd).splitlines():
        if found := re.search(r"Chunk\(.*?\) with (\d+) rows .* - /([^ ]+) -", line):
            rows[found[2]] = rows.get(found[2], 0) + int(found[1])
    return rows


def test_a_file_holds_everything_from_the_first_frame_and_ends_by_itself(start: Start, tmp_path: Path) -> None:
    device = start("device", 90, 30)
    view = start("view", "--headless", "--rrd", tmp_path / "session.rrd")
    device.wait_for("ended", 60)
    assert view.process.wait(20) == 0
    _rerun("rrd", "verify", tmp_path / "session.rrd")
    rows = _rows(tmp_path / "session.rrd")
    assert rows["world/camera"] == 90
    assert 30 <= rows["world/camera/color"] <= 92
    for path in ("world/online", "world/corrected", "world/truth/camera", "world/camera/depth", "log", "summary"):
        assert rows[path] >= 1, path


def test_a_late_viewer_shows_the_whole_trajectory_and_a_killed_one_comes_back(start: Start, tmp_path: Path) -> None:
    device = start("device", 400, 60, "now")
    device.wait_for("frame 150", 30)
    first = start("view", "--headless", "--rrd", tmp_path / "first.rrd")
    device.wait_for("frame 210", 30)
    first.process.send_signal(signal.SIGKILL)
    second = start("view", "--headless", "--rrd", tmp_path / "second.rrd")
    device.wait_for("ended", 60)
    assert second.process.wait(20) == 0
    lines = _rerun("rrd", "print", "-vvv", "--entity", "/world/online", tmp_path / "second.rrd")
    assert "0.0, 0.0, 0.0" in lines.replace("[", "").replace("]", "")[:2_000_000]


def test_a_frozen_viewer_holds_nobody_up(start: Start, tmp_path: Path) -> None:
    device = start("device", 600, 60)
    view = start("view", "--web", "--web-port", "0", "--data-port", "0")
    device.wait_for("frame 60", 60)
    view.process.send_signal(signal.SIGSTOP)
    device.wait_for("ended", 40)
    slowest = float(device.wait_for(r"slowest ([\d.]+)", 5))
    view.process.send_signal(signal.SIGCONT)
    assert slowest < 0.25
    assert view.stop() == 0


def test_the_page_is_on_loopback_only_takes_free_ports_and_goes_with_the_viewer(start: Start) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        taken = other.getsockname()[1]
        view = start("view", "--web", "--web-port", taken, "--data-port", taken)
        address = view.wait_for(r"viewer: (http://127\.0\.0\.1:\d+/\?url=rerun%2Bhttp://127\.0\.0\.1:\d+/proxy)", 30)
    deadline = time.monotonic() + 20
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


def test_ctrl_c_ends_cleanly(start: Start, tmp_path: Path) -> None:
    device = start("device", 600, 30)
    view = start("view", "--headless", "--rrd", tmp_path / "cut.rrd")
    device.wait_for("frame 30", 60)
    view.process.send_signal(signal.SIGINT)
    assert view.process.wait(20) == 0
    _rerun("rrd", "verify", tmp_path / "cut.rrd")


@pytest.mark.parametrize(
    ("arguments", "status"),
    [(["--headless"], 2), (["--web", "--headless"], 2), (["--web", "--web-port", "70000"], 2)],
)
def test_options_that_make_no_sense_are_refused(arguments: list[str], status: int) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "odom", "view", *arguments], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == status, done.stderr
    assert "Traceback" not in done.stderr


def test_a_file_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    arguments = ["view", "--headless", "--rrd", str(tmp_path / "file" / "x.rrd")]
    done = subprocess.run([sys.executable, "-m", "odom", *arguments], capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert "cannot be written" in done.stderr


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_memory_stays_flat_over_10000_frames(start: Start) -> None:
    device = start("device", 10_000, 60)
    view = start("view", "--web", "--web-port", "0", "--data-port", "0")
    rss: list[float] = []
    while device.said("ended") is None:
        time.sleep(2.0)
        rss.append(sum(process.memory_info().rss for process in view.family()) / 2**20)
    print(f"viewer and server: {max(rss):.0f} MiB at most, {rss[len(rss) // 2]:.0f} half way, {rss[-1]:.0f} at the end")
    assert max(rss) < 1024
    assert max(rss[-10:]) < 1.1 * max(rss[len(rss) // 3 : len(rss) // 2])
