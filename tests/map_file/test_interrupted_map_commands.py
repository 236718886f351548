"""A command on maps that is asked to end, in whatever way, leaves no half of a map behind."""

import signal
import subprocess
import sys

import made_up_map
import pytest

pytestmark = pytest.mark.process

STOPS_BEFORE_THE_END = """
import sys, time
from odom.cli import app
from odom.map_file import new_map

def fill(path, *rest, whole=new_map._fill):
    whole(path, *rest)
    print("filled", flush=True)
    time.sleep(60)

new_map._fill = fill
app(sys.argv[1:])
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupted_merge_leaves_nothing_behind(tmp_path, number):
    maps = [tmp_path / "a.map", tmp_path / "b.map"]
    for day, path in enumerate(maps, 1):
        made_up_map.make(path, 3, day=day)
    before = sorted(tmp_path.iterdir())
    words = ["map", "merge", *maps, "-o", tmp_path / "new.map"]
    merge = subprocess.Popen(
        [sys.executable, "-c", STOPS_BEFORE_THE_END, *map(str, words)],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    assert merge.stdout is not None
    assert "filled\n" in merge.stdout
    assert len(list(tmp_path.iterdir())) > len(before)
    merge.send_signal(number)
    merge.communicate(timeout=30)
    assert merge.returncode not in (0, -number)
    assert sorted(tmp_path.iterdir()) == before
