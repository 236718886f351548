"""What ten thousand key frames cost; made up, see `large_map`."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow


def test_ten_thousand_key_frames_are_opened_searched_and_closed_beside_the_frames(tmp_path: Path) -> None:
    script, map_ = Path(__file__).with_name("large_map.py"), tmp_path / "large.map"
    subprocess.run([sys.executable, script, "make", map_, "--keyframes", "10000"], check=True)
    for _ in range(2):  # the first time it compiles, which takes memory
        done = subprocess.run([sys.executable, script, "measure", map_], check=True, capture_output=True, text=True)
    cost = json.loads(done.stdout.splitlines()[-1])
    print(cost)
    assert cost["open_s"] <= 1.0
    assert cost["file_mb_a_keyframe"] <= 0.4
    assert cost["recognised"] == 1.0
    assert cost["query_ms"] <= 30.0
    assert cost["closed_after_s"] <= 2.0
    assert cost["least_frame_ms"] <= 5.0
    assert cost["rss_mb"] <= 600.0
