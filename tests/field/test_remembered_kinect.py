"""A device whose driver tells a wrong field of view: its own calibration is remembered, and begun with next time."""

import json
from pathlib import Path

import numpy as np
import pytest
from playing import PlayingKinect
from rig import processes

from sensors.calibration_file import load_calibration

SECONDS = 15
TRUE_FX, TOLD_FX = 262.5, 275.0


def ran(rig: PlayingKinect, name: str) -> tuple[dict, str]:
    """What a run with --remember reports, and what it said."""
    rig.out, rig.recording = rig.folder / name, rig.folder / f"{name}.mcap"
    with processes() as started:
        started.append(rig.live(SECONDS, "--remember"))
        assert started[0].popen.wait(SECONDS + 240) == 0, started[0].said
    return json.loads((rig.out / "report.json").read_text()), started[0].said


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_what_a_run_finds_is_remembered_for_the_device_and_used_by_the_next(
    rig: PlayingKinect, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    half = np.array([320 / TOLD_FX, 240 / TOLD_FX]) / 2.0
    rig.kinect.configure(horizontal_fov=2 * np.arctan(half[0]), vertical_fov=2 * np.arctan(half[1]))
    first, said = ran(rig, "first")
    remembered = tmp_path / "data" / "odom" / "cameras" / "VK42.yaml"
    print(first["calibration"]["fx"], first.get("calibration_kept"))
    assert first["calibration"]["fx"][0] == pytest.approx(TOLD_FX, abs=0.1)
    assert "remembered for serial VK42" in said
    fx = load_calibration(remembered).camera.fx  # the second run may find a better one, and remember that
    assert fx == pytest.approx(TRUE_FX, abs=3.0)
    second, said = ran(rig, "second")
    assert str(remembered) in said
    assert second["calibration"]["fx"][0] == pytest.approx(fx, abs=1e-3)
    assert load_calibration(remembered).camera.fx == pytest.approx(TRUE_FX, abs=3.0)
