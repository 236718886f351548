"""Ctrl-C ends the commands that work on files with what was done so far saved."""

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from odom.cli import signals
from odom.errors import ConfigError
from odom.frame import Stamp
from odom.wire import Topics, codec
from odom.wire.recording import RecordingReader, RecordingWriter
from sensors.catalogue import check_source
from sensors.source import SourceOptions

Start = Callable[..., "subprocess.Popen[str]"]
Eventually = Callable[..., None]

MESSAGES = 300


def test_an_interrupted_recover_leaves_a_sound_recording(odom: Start, eventually: Eventually, tmp_path: Path) -> None:
    whole, mended = tmp_path / "whole.mcap", tmp_path / "mended.mcap"
    noise = np.random.default_rng(1).integers(0, 256, (480, 640, 3), dtype=np.uint8)
    with RecordingWriter(whole, "none") as writer:
        for i in range(MESSAGES):
            writer.write(codec.encode_color(Topics().color, Stamp(i), noise))
    recover = odom("recover", whole, mended)
    eventually(lambda: any(tmp_path.glob("mended.mcap.*")), 60, "the file")
    recover.send_signal(signal.SIGINT)
    words, _ = recover.communicate(timeout=30)
    assert recover.returncode == 0, words
    assert "(interrupted)" in words
    reader = RecordingReader(mended)
    assert 0 < sum(1 for _ in reader.messages()) < MESSAGES
    assert reader.complete
    assert reader.counts() is not None


def test_an_interrupted_measurement_gives_the_figures_so_far(
    odom: Start, eventually: Eventually, tmp_path: Path
) -> None:
    figures, words = tmp_path / "cost.json", []
    bench = odom("bench", "pipeline", "arena", "--seconds", "100", "--json", figures, ODOM_COUNT="1")
    assert bench.stdout is not None
    for line in bench.stdout:
        words.append(line)
        if line.startswith("@count") and int(line.split()[1]) > 5:
            break
    bench.send_signal(signal.SIGINT)
    words.append(bench.communicate(timeout=60)[0])
    assert bench.returncode == 0, words
    assert 5 < json.loads(figures.read_text())["frames"] < 1000
    assert "total" in words[-1]


HANGS_UP = """
import os, signal, sys
from odom.cli import signals

if sys.argv[1] == "nohup":
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
stop = signals.stop_event()
os.kill(os.getpid(), signal.SIGHUP)
print(stop.wait(0.5))
"""


@pytest.mark.parametrize(("how", "ends"), [("shell", True), ("nohup", False)])
def test_a_terminal_that_is_closed_ends_it_like_a_request_unless_it_is_ignored(how: str, ends: bool) -> None:
    done = subprocess.run(
        [sys.executable, "-c", HANGS_UP, how], timeout=60, check=False, capture_output=True, text=True
    )
    assert (done.returncode, done.stdout) == (0, f"{ends}\n"), done.stderr


FAILS = """
import os, signal, sys
from odom.cli import signals

class Last:
    def __del__(self, kill=os.kill, me=os.getpid(), number=signal.SIGTERM):
        kill(me, number)

signals.stop_event()
sys.last = Last()  # goes when the interpreter has put its signal handlers away
sys.exit(1)
"""


def test_a_request_to_end_that_comes_during_the_shutdown_leaves_the_exit_status() -> None:
    assert subprocess.run([sys.executable, "-c", FAILS], timeout=60, check=False).returncode == 1


OPENS = """
import os, signal, sys, threading, time
from odom.cli import signals

stop = signals.stop_event()
assert signals.before(stop, lambda: 3) == 3
threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGTERM)).start()
print("nothing was done")
signals.before(stop, lambda: time.sleep(60))
"""


def test_a_source_that_takes_long_to_open_does_not_delay_the_end() -> None:
    done = subprocess.run([sys.executable, "-c", OPENS], timeout=30, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "nothing was done\n", "")


def test_what_fails_while_nothing_is_begun_is_told() -> None:
    stop = threading.Event()
    with pytest.raises(ConfigError, match="no such file"):
        signals.before(stop, lambda: check_source("nothing.mcap", SourceOptions()))
