"""A real browser sees the live run."""

import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from web_picture import HEIGHT, PANELS, WIDTH, empty_panels, photograph

ARENA = Path(__file__).parents[2] / "recordings" / "arena.mcap"

needs_chromium = pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium: apt-get install chromium")


def _look(tmp_path: Path, *arguments: str) -> np.ndarray:
    """Photograph the page of a run as soon as no panel is empty; the run's words are printed when that fails."""
    command = [sys.executable, "-m", "odom", "run", *arguments, "--web", "--stay", "--out", str(tmp_path / "out")]
    words = tmp_path / "words.txt"
    with words.open("wb") as file:
        run = subprocess.Popen(command, stdout=file, stderr=subprocess.STDOUT)
    try:
        deadline = time.monotonic() + 60
        while (found := re.search(r"viewer: (http\S+)", words.read_text())) is None:
            assert time.monotonic() < deadline, words.read_text()
            assert run.poll() is None, words.read_text()
            time.sleep(0.2)
        return photograph(found[1], tmp_path / "seen.png", 180.0, lambda seen: not empty_panels(seen))
    finally:
        run.terminate()
        run.wait(60)
        print(words.read_text()[-3000:])


@pytest.mark.wallclock
@needs_chromium
def test_no_panel_of_the_page_is_empty_during_a_run(tmp_path: Path) -> None:
    picture = _look(tmp_path, str(ARENA))
    assert empty_panels(picture) == []


@needs_chromium
@pytest.mark.slow
@pytest.mark.timeout(900)
def test_no_panel_of_the_page_is_empty_during_a_simulated_session(tmp_path: Path) -> None:
    assert empty_panels(_look(tmp_path, "arena")) == []


def test_the_check_of_the_panels_can_fail() -> None:
    dark = np.full((HEIGHT, WIDTH, 3), 13, dtype=np.uint8)
    assert set(empty_panels(dark)) == set(PANELS)
    noisy = cv2.randn(dark.copy(), (20, 20, 20), (3, 3, 3))
    assert set(empty_panels(np.asarray(noisy))) == set(PANELS)
