"""Every line of the log is whole, and under `--log-json` every one is JSON."""

import json
import logging
import os
import pty
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from painted_wall import CAMERA, write_wall

from odom.cli import logs
from odom.service.log_form import JSON_ENVIRONMENT
from odom.service.progress import Reading, open_display

ODOM = [sys.executable, "-m", "odom"]


def objects(stderr: str) -> list[dict[str, object]]:
    """The lines of stderr, each of which is a JSON object with a message."""
    found = [json.loads(line) for line in stderr.splitlines()]
    assert all({"time", "level", "message"} <= line.keys() for line in found)
    return found


def test_nothing_plain_is_in_the_log_of_a_run(compiled: None, tmp_path: Path) -> None:
    folder = write_wall(tmp_path / "wall", frames=30)
    (folder / "camera.yaml").write_text(CAMERA)
    for i in range(8):
        picture = folder / "rgb" / f"{i:03}.png"
        picture.write_bytes(picture.read_bytes()[:-200])
    command = [*ODOM, "--log-json", "run", folder, "--headless", "--out", tmp_path / "out"]
    done = subprocess.run(command, timeout=120, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    told = [str(line["message"]) for line in objects(done.stderr)]
    assert any("to watch it" in words for words in told)
    assert any("30 frames" in words for words in told)
    assert any("messages sent" in words for words in told)  # what the sensor says on its stdout
    assert "frames tracked" in done.stdout


WRONG = {
    "a typing error": (["run", "typo.mcap"], 2, "no such file"),
    "an unknown option": (["run", "--nonsense"], 2, "--nonsense"),
    "a bad value": (["run", "arena", "--seed", "x"], 2, "--seed"),
    "a wrong setting": (["serve", "--config", "typo.yaml"], 2, "typo.yaml"),
    "a damaged file": (["info", __file__], 1, "MCAP"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_refusal_is_json(tmp_path: Path, what: str) -> None:
    arguments, status, words = WRONG[what]
    environment = {**os.environ, JSON_ENVIRONMENT: "1"}
    done = subprocess.run(
        [*ODOM, *arguments], timeout=60, check=False, capture_output=True, text=True, cwd=tmp_path, env=environment
    )
    assert done.returncode == status
    assert any(words in str(line["message"]) for line in objects(done.stderr)), done.stderr


FOREIGN = """
import os, sys, warnings, logging
from odom.cli import logs
from odom.cli.json_lines import wrap_stderr
from odom.cli.streams import outlive_readers
outlive_readers()
logs.lead_to(wrap_stderr())
logs.configure(logs.Level.INFO, as_json=True)
os.write(2, b"words of a library\\n\\n")
print('{"message": "of a child", "level": "INFO", "time": 1}', file=sys.stderr)
warnings.warn("beware")
logging.info("two\\nlines")
os.system("echo of a shell >&2")
raise RuntimeError("boom")
"""


def test_words_of_libraries_and_tracebacks_are_json() -> None:
    done = subprocess.run([sys.executable, "-c", FOREIGN], timeout=60, check=False, capture_output=True, text=True)
    told = [str(line["message"]) for line in objects(done.stderr)]
    assert done.returncode == 1
    for words in ("words of a library", "of a child", "two\nlines", "of a shell", "RuntimeError: boom"):
        assert words in told
    assert any("beware" in words for words in told)


@pytest.mark.process
def test_lines_beside_a_progress_bar_are_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """Log lines of this process and of children, from several threads, over a bar on a narrow terminal."""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "60")
    main, terminal = pty.openpty()
    shown: list[bytes] = []

    def read() -> None:
        while data := os.read(main, 1 << 16):
            shown.append(data)
            if b"the end" in b"".join(shown[-2:]):
                return

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    handlers = logging.getLogger().handlers[:]
    with os.fdopen(terminal, "w") as stream:
        monkeypatch.setattr("sys.stderr", stream)
        monkeypatch.delenv(JSON_ENVIRONMENT, raising=False)
        logs.configure(logs.Level.INFO, as_json=False)
        with open_display() as display:
            words = [f"{name} {i} " + "said at some length " * 6 + "." for name in "abc" for i in range(20)]
            threads = [
                threading.Thread(target=lambda name=name: [display.say("child", w) for w in words if w[0] == name])
                for name in "ab"
            ]
            for thread in threads:
                thread.start()
            for i, line in enumerate(w for w in words if w[0] == "c"):
                display.show(Reading(i, 20, 30.0, "TRACKING"))
                logging.getLogger("own").info("%s", line)
            for thread in threads:
                thread.join()
        stream.write("the end\n")
        stream.flush()
        reader.join(10)
    logging.getLogger().handlers[:] = handlers
    text = b"".join(shown).decode()
    for line in words:
        assert line in text, line
    assert not any("TRACKING" in line and "said at" in line for line in text.replace("\r", "\n").splitlines())
