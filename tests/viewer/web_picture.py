"""A real browser looks at the live viewer: what is in each panel, and the picture for the README.

`python tests/viewer/web_picture.py OUT.png [SOURCE, ADDRESS or FILE.rrd]` photographs the viewer of a whole run (of
the arena, if nothing else is said), the one at ADDRESS, or a file in Rerun's window (xvfb, mesa's software driver).
"""

import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.viewer import palette

WIDTH, HEIGHT = 1600, 900
_SOFTWARE = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
_LOOK_S, _SHOT_MS = 3.0, 90_000
_PATIENCE_S = 200.0

Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class Panel:
    """Where a view is in the blueprint's layout, as shares of the window: left, top, right, bottom."""

    left: float
    top: float
    right: float
    bottom: float

    def of(self, picture: Picture) -> Picture:
        """Return the pixels of the view, RGB."""
        h, w = picture.shape[:2]
        return picture[int(self.top * h) : int(self.bottom * h), int(self.left * w) : int(self.right * w)]


PANELS: Mapping[str, Panel] = {
    "map": Panel(0.005, 0.075, 0.55, 0.68),
    "summary": Panel(0.005, 0.72, 0.20, 0.955),
    "log": Panel(0.215, 0.755, 0.545, 0.955),
    "colour": Panel(0.558, 0.075, 0.776, 0.372),
    "depth": Panel(0.780, 0.075, 0.998, 0.372),
    "position error": Panel(0.575, 0.41, 0.776, 0.655),
    "rotation error": Panel(0.797, 0.41, 0.998, 0.655),
    "inliers": Panel(0.580, 0.705, 0.776, 0.955),
    "times": Panel(0.800, 0.705, 0.998, 0.955),
}


def near(pixels: Picture, color: tuple[int, ...], tolerance: int = 30) -> int:
    """Return how many pixels have about this colour."""
    distance = np.abs(pixels.astype(np.int64) - np.array(color[:3])).max(axis=2)
    return int((distance <= tolerance).sum())


def _varied(pixels: Picture) -> float:
    """Return the standard deviation of the brightness."""
    return float(pixels.mean(axis=2).std())


CHECKS: Mapping[str, Callable[[Picture], bool]] = {
    "map": lambda p: (
        min(near(p, palette.ONLINE), near(p, palette.CORRECTED), near(p, palette.TRUTH, 15)) > 40 and _varied(p) > 12
    ),
    "summary": lambda p: near(p, (200, 200, 200), 60) > 300,
    "log": lambda p: near(p, palette.GOOD, 60) + near(p, (200, 200, 200), 60) > 300,
    "colour": lambda p: _varied(p) > 25 and near(p, palette.GOOD, 40) > 20,
    "depth": lambda p: _varied(p) > 12 and len(np.unique(p.reshape(-1, 3) // 16, axis=0)) > 12,
    "position error": lambda p: near(p, palette.CORRECTED) > 60,
    "rotation error": lambda p: near(p, palette.CORRECTED) > 60,
    "inliers": lambda p: near(p, palette.GOOD) > 60,
    "times": lambda p: near(p, palette.CORRECTED) > 60,
}


def empty_panels(picture: Picture) -> list[str]:
    """Return the panels that do not show what they are for."""
    return [name for name, check in CHECKS.items() if not check(PANELS[name].of(picture))]


@contextmanager
def browser_page() -> Iterator[Any]:
    """Open a page of Debian's chromium, dark, drawing in software."""
    from playwright.sync_api import sync_playwright

    program = shutil.which("chromium")
    if program is None:
        raise FileNotFoundError("no chromium: apt-get install chromium")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=program, args=list(_SOFTWARE))
        yield browser.new_page(color_scheme="dark", viewport={"width": WIDTH, "height": HEIGHT})
        browser.close()


def photograph(address: str, out: Path, timeout_s: float, satisfied: Callable[[Picture], bool]) -> Picture:
    """Open the viewer and take pictures until one satisfies or the time is over; return the last, saved to `out`."""
    deadline = time.monotonic() + timeout_s
    with browser_page() as page:
        page.goto(f"{address}&renderer=webgl", timeout=_SHOT_MS)
        while True:
            data = page.screenshot(timeout=_SHOT_MS)
            bgr = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_COLOR)
            picture = np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)
            out.write_bytes(data)
            if satisfied(picture) or time.monotonic() > deadline:
                return picture
            time.sleep(_LOOK_S)


def _photograph_file(recording: Path) -> Picture:
    """Return what Rerun's own window shows of a file, drawn in software without a screen."""
    package = find_spec("rerun_cli")
    assert package is not None
    program = Path(str(package.origin)).with_name("rerun")
    with TemporaryDirectory() as folder:
        shot = Path(folder) / "shot.png"
        size = f"{WIDTH}x{HEIGHT}"
        command = ["xvfb-run", "-a", program, recording, "--screenshot-to", shot, "--window-size", size]
        subprocess.run(command, check=True, timeout=300, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        bgr = cv2.resize(cv2.imread(str(shot)), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def _shrink(picture: Picture, out: Path) -> None:
    """Save with 256 colours, and say what is missing."""
    from PIL import Image

    out.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).quantize(256).save(out, optimize=True)
    print(f"{out}: {out.stat().st_size / 1024:.0f} KiB, empty: {', '.join(empty_panels(picture)) or 'none'}")


def main(out: str, source: str = "arena") -> None:
    """Take the README's picture: of a whole run of `source`, of the page at that address, or of a file for Rerun."""
    if source.endswith(".rrd"):
        _shrink(_photograph_file(Path(source)), Path(out))
        return
    run, address = None, source if source.startswith("http") else None
    if address is None:
        command = [sys.executable, "-m", "odom", "run", source, "--web", "--stay", "--out", "out/picture"]
        run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        assert run.stdout is not None
        for line in run.stdout:
            found = re.search(r"viewer: (http\S+)", line)
            address = found.group(1) if found else address
            if "the source has ended;" in line:
                break
    assert address is not None, "the run printed no address"
    Path(out).parent.mkdir(parents=True, exist_ok=True)
    picture = photograph(address, Path(out), _PATIENCE_S, lambda seen: False)  # all of it has loaded by then
    _shrink(picture, Path(out))
    if run is not None:
        run.terminate()
        run.wait()


if __name__ == "__main__":
    main(*sys.argv[1:])
