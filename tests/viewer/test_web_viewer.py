"""A real browser sees the live run."""

import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import cv2
import numpy as np
import pytest
from web_picture import HEIGHT, PANELS, WIDTH, empty_panels, photograph

ARENA = Path(__file__).parents[2] / "recordings" / "arena.mcap"

needs_chromium = pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium: apt-get install chromium")


def _look(tmp_path: Path, *arguments: str) -> np.ndarray:
    command = [sys.executable, "-m", "odom", "run", *arguments, "--web", "--stay", "--out", str(tmp_path / "out")]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        assert run.stdout is not None
        lines = []
        for line in run.stdout:
            lines.append(line)
            if found := re.search(r"viewer: (http\S+)", line):
                break
        else:
            pytest.fail("".join(lines))
        threading.Thread(target=run.stdout.read, daemon=True).start()
        return photograph(found[1], tmp_path / "seen.png", 150.0, lambda seen: not empty_panels(seen))
    finally:
        run.terminate()
        run.wait(60)


@needs_chromium
def test_no_panel_of_the_page_is_empty_during_a_run(tmp_path: Path) -> None:
    picture = _look(tmp_path, str(ARENA), "--realtime")
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
