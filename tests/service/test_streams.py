"""Work goes on when nobody reads what is said about it."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

Start = Callable[..., "subprocess.Popen[str]"]
RECORDING = Path(__file__).parents[2] / "recordings" / "arena.mcap"

CHATTERS = """
import contextlib, logging, os, sys
from odom.cli.streams import outlive_readers
outlive_readers()
logging.basicConfig(stream=sys.stderr, force=True)
for _ in range(20_000):
    print("result", flush=True)
    print("plain words", file=sys.stderr)
    logging.error("a line of the log")
    with contextlib.suppress(BrokenPipeError):  # its own loss, if its words are the first that find no reader
        os.write(2, b"words of a library\\n")
with open("done", "w") as file:
    file.write(str(file.fileno()))
"""
HOW = {
    "pipe": "{python} -c '{program}' 2>&1 | head -1",
    "closed": "{python} -c '{program}' <&- >&- 2>&-",
    "full log": "{python} -c '{program}' >/dev/null 2>/dev/full",
}


@pytest.mark.parametrize("how", HOW)
def test_a_process_outlives_the_readers_of_its_words(tmp_path: Path, how: str) -> None:
    line = HOW[how].format(python=sys.executable, program=CHATTERS)
    subprocess.run(["bash", "-c", f"set -o pipefail; {line}"], cwd=tmp_path, timeout=120, check=True)
    assert int((tmp_path / "done").read_text()) > 2  # no file takes the place of a closed stream


def test_results_that_find_no_room_are_a_failure(tmp_path: Path) -> None:
    line = f"{sys.executable} -m odom config >/dev/full"
    done = subprocess.run(["bash", "-c", line], cwd=tmp_path, timeout=120, check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert "No space left" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_run_whose_log_is_no_longer_read_goes_on(compiled: None, tmp_path: Path) -> None:
    run = f"{sys.executable} -m odom run {RECORDING} --end 2 --headless --out out"
    subprocess.run(["bash", "-c", f"set -o pipefail; {run} 2>&1 | head -1"], cwd=tmp_path, timeout=240, check=True)
    assert len((tmp_path / "out" / "odometry.txt").read_text().splitlines()) == 15
    assert "elapsed_s" in (tmp_path / "out" / "report.json").read_text()
