"""The picture of a calibration can be read, wherever the recording lies and however near all of it was."""

from types import SimpleNamespace

import pytest
from sheets import cut, on_each_other, sheets_drawn

from odom.calibration.adjustment import start_of
from odom.calibration.parameters import vector_of
from odom.calibration.residual_picture import draw
from odom.calibration.result import Judgement
from tests.calibration.made_up_walk import SHEET, made_up_survey, spoilt

LONG = "/data/" + "recordings of the laboratory/" * 8 + "walk_$1_{$2.mcap"


@pytest.mark.parametrize("source", ["walk.mcap", LONG])
def test_the_picture_of_a_calibration_can_be_read(tmp_path, monkeypatch, source):
    drawn = sheets_drawn(monkeypatch)
    survey = made_up_survey(spoilt(fx=5.0))
    fits = [SimpleNamespace(vector=v, bundle=start_of(survey)) for v in (vector_of(SHEET), spoilt(fx=5.0))]
    draw(
        tmp_path / "camera.png",
        survey,
        Judgement(None, None, True, fits),
        f"odom calibrate {source}: 90 frames adjusted 3 times",
    )
    assert drawn[0].get_suptitle().endswith("3 times")
    assert not cut(drawn[0])
    titles = {panel.get_title() for panel in drawn[0].axes}  # wide, a little over the numbers beside them
    assert not [pair for pair in on_each_other(drawn[0]) if not titles & set(pair)]
