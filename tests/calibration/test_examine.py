"""Faults of a calibration that would cost accuracy are named with their cost and the remedy; a good one is not."""

from types import SimpleNamespace

import numpy as np
import pytest
from made_up_walk import SHEET, made_up_survey, spoilt, straight

from odom.calibration.examine import _judge_stretch, judge_survey
from odom.calibration.parameters import STRETCH, vector_of
from odom.evaluation.diagnosis.finding import Verdict
from odom.evaluation.diagnosis.scale import ScaleFit


def verdicts(vector, scale=None, **walk):
    return {finding.key: finding for finding in judge_survey(made_up_survey(vector, **walk), scale)}


def test_a_good_calibration_has_no_fault():
    found = verdicts(vector_of(SHEET), ScaleFit(1.004, 0.003, 0.3))
    assert {finding.verdict for finding in found.values()} == {Verdict.GOOD}


@pytest.mark.parametrize(
    ("numbers", "key", "cost"),
    [
        ({"fx": 15.0, "fy": 15.0}, "focal length, walk", "28 mm a metre"),
        ({"shift_u_px": 5.0, "shift_v_px": 3.0}, "registration, walk", "mm aside"),
        ({"baseline_u": -13.0}, "registration, walk", "mm aside"),
        ({"stretch_u": -0.11, "stretch_v": -0.11}, "registration over the image, walk", "583 and 583 px"),
    ],
)
def test_a_fault_is_named_with_its_cost_and_the_remedy(numbers, key, cost):
    found = verdicts(spoilt(**numbers))
    assert [finding.key for finding in found.values() if finding.verdict is Verdict.BAD] == [key]
    assert "odom calibrate" in found[key].advice
    assert cost in found[key].advice


@pytest.mark.parametrize(("true", "words"), [(0.0, "out of date"), (-0.21, "635 and 635 px")])
def test_depth_whose_given_stretch_is_not_the_true_one_is_named_by_its_own_focal_lengths(true, words):
    stretched = np.full(2, -0.11)
    found, vector = SimpleNamespace(camera=SHEET), vector_of(SHEET)
    found.start, found.vector = vector.copy(), vector
    found.start[STRETCH], found.vector[STRETCH] = stretched, true
    found.sigma, found.shown = np.full(len(vector), 1e-4), np.ones(len(vector), dtype=bool)
    finding = _judge_stretch(found)
    assert finding.verdict is Verdict.BAD
    assert words in finding.advice


def test_a_wrong_unit_is_named_by_motion_capture():
    found = verdicts(vector_of(SHEET), ScaleFit(0.97, 0.004, 0.3))["depth unit, walk"]
    assert found.verdict is Verdict.BAD
    assert "30 mm a metre" in found.advice


def test_what_a_slide_does_not_show_is_not_judged():
    found = verdicts(spoilt(fx=15.0), walk=straight)
    assert found["focal length, walk"].verdict is Verdict.UNKNOWN
