"""`odom bench pipeline` on a recording made for the purpose."""

import json
import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from painted_room import SMALL, PaintedRoom, stroll

from odom.bench.pipeline_comparison import compared, read_cost
from odom.errors import ConfigError

STAGES = ["decode", "images", "predict", "track", "odometry", "total"]
CAMERA_YAML = """
image_width: 320
image_height: 240
camera_matrix: {{rows: 3, cols: 3, data: [{0.fx}, 0, {0.cx}, 0, {0.fy}, {0.cy}, 0, 0, 1]}}
distortion_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}}
depth_scale: 1000
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A TUM folder of a painted room."""
    out = tmp_path_factory.mktemp("room")
    lists: dict[str, list[str]] = {"rgb": [], "depth": []}
    for name in lists:
        (out / name).mkdir()
    for k in range(64):
        images = dict(zip(lists, PaintedRoom().render(SMALL, stroll(k / 30.0)), strict=True))
        for name, lines in lists.items():
            file = f"{name}/{k:03d}.png"
            cv2.imwrite(str(out / file), images[name])
            lines.append(f"{1000 + k / 30.0:.6f} {file}")
    for name, lines in lists.items():
        (out / f"{name}.txt").write_text("\n".join(lines) + "\n")
    (out / "camera.yaml").write_text(CAMERA_YAML.format(SMALL))
    return out


def bench(*arguments):
    command = [sys.executable, "-m", "odom", "bench", "pipeline", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=240, check=False)


@pytest.fixture(scope="module")
def measured(folder):
    """What was printed of the whole folder, and the file written."""
    file = folder / "cost.json"
    done = bench(folder, "--json", file)
    assert done.returncode == 0, done.stderr
    return done, file


def test_the_cost_of_every_stage_is_printed_and_written(measured):
    done, file = measured
    cost = json.loads(file.read_text())
    stages = {s["stage"]: s for s in cost["stages"]}
    assert [s for s in stages if s in STAGES] == STAGES
    assert all(stage in done.stdout for stage in STAGES)
    assert cost["frames"] == 64
    for s in cost["stages"]:
        assert 0.0 <= s["p50_ms"] <= s["p95_ms"] <= s["p99_ms"]
    inner = [s["mean_ms"] for name, s in stages.items() if name not in ("decode", "odometry", "total")]
    assert np.sum(inner) <= stages["odometry"]["mean_ms"] <= stages["total"]["mean_ms"]
    assert cost["frames_a_second"] == pytest.approx(1e3 / stages["total"]["mean_ms"], rel=1e-6)
    assert 0.0 < cost["background_ms_a_frame"] < cost["cpu_ms_a_frame"]
    assert f"is {cost['follow_ms'] + stages['decode']['mean_ms']:.2f} ms" in done.stdout


def test_a_run_is_compared_with_an_earlier_one_frame_by_frame(folder, measured):
    _, file = measured
    again = bench(folder, "--frames", 62, "--against", file)
    assert again.returncode == 0, again.stderr
    table = again.stdout.split("the same frames before and now")[1]
    assert all(stage in table for stage in STAGES)
    assert "at the machine's speed of then" in table


def test_stages_that_cost_half_of_before_are_told_to(measured):
    before = read_cost(measured[1])
    halved = replace(before, stages=tuple(replace(s, each_ms=tuple(ms / 2 for ms in s.each_ms)) for s in before.stages))
    assert [c.ratio for c in compared(before, halved) if c.before_ms > 0.0] == pytest.approx(
        [0.5] * sum(np.median(s.each_ms) > 0.0 for s in before.stages)
    )


def test_a_comparison_without_common_frames_is_refused(measured):
    before = read_cost(measured[1])
    with pytest.raises(ConfigError, match="share 0 frames"):
        compared(before, replace(before, stamps_ns=tuple(stamp + 1 for stamp in before.stamps_ns)))


@pytest.mark.parametrize("content", [None, "", "{}", '{"frames": 3}'])
def test_a_file_of_something_else_is_refused_before_anything_is_measured(folder, tmp_path, content):
    file = tmp_path / "other.json"
    if content is not None:
        file.write_text(content)
    done = bench(folder, "--against", file)
    assert done.returncode == 2
    assert "other.json" in done.stderr
    assert "Traceback" not in done.stderr


def test_it_stops_after_as_many_frames_as_asked_for(folder, tmp_path):
    assert bench(folder, "--frames", 7, "--json", tmp_path / "cost.json").returncode == 0
    assert json.loads((tmp_path / "cost.json").read_text())["frames"] == 7


def test_a_source_that_is_not_there_is_said_to_be_so(tmp_path):
    done = bench(tmp_path / "none")
    assert done.returncode in (1, 2)
    assert "none" in done.stderr
    assert "Traceback" not in done.stderr
