"""A program makes a map and goes on in it as the page on maps shows."""

import re
from pathlib import Path

import odom

PROJECT = Path(__file__).parents[2]


def test_the_program_of_the_page_on_maps_makes_a_map_and_goes_on_in_it(tmp_path, monkeypatch):
    (program,) = re.findall(
        r"^```python\n(.*?)^```", (PROJECT / "odom/docs/map.md").read_text(), re.MULTILINE | re.DOTALL
    )
    recording = odom.read_recording(PROJECT / "recordings" / "arena.mcap", end=2.0)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(odom, "read_recording", lambda path: recording)
    first, second = {}, {}
    exec(program, first)
    exec(program.replace("is_written=True", "is_written=False"), second)
    made, found = ([k.stamp for k in each["odometry"].map.keyframes] for each in (first, second))
    assert len(made) > 1
    assert first["map_file"].unwritten == 0
    assert found[: len(made)] == made
    assert second["odometry"].finish()[0].T_map_camera is not None
