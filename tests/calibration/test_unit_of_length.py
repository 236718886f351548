"""A calibration leaves the unit of length where it was, as far as nothing was measured against a metre."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from made_up_walk import SHEET, made_up_survey, spoilt

from odom.calibration.adjustment import start_of
from odom.calibration.linearised import linearised
from odom.calibration.parameters import SCALE_NUMBER, camera_of, vector_of
from odom.calibration.result import Calibrated, calibrated
from odom.calibration.survey import Survey
from odom.calibration.tuning import TUNING
from odom.calibration.unit_of_length import (
    depth_change,
    in_believed_unit,
    in_metres,
    in_unit_of_depth,
    lens_change,
    size_belief,
)
from odom.evaluation.diagnosis.scale import ScaleFit


@cache
def survey() -> Survey:
    return made_up_survey(spoilt(fx=8.0, fy=8.0))


@cache
def found() -> Calibrated:
    return calibrated(survey(), SHEET)


def with_vector(vector: np.ndarray) -> Calibrated:
    return replace(found(), vector=vector, camera=camera_of(vector, SHEET))


@pytest.mark.parametrize("numbers", [{"offset_1": 0.01}, {"scale_xx": 0.03}, {"offset_1": -0.01, "scale_yy": 0.02}])
def test_a_correction_of_depth_leaves_the_usual_depth_alone(numbers):
    bent = with_vector(spoilt(**numbers))
    assert abs(depth_change(bent, survey())) > 0.003
    assert depth_change(in_unit_of_depth(bent, survey()), survey()) == pytest.approx(0.0, abs=1e-3)


def test_a_longer_lens_is_told_by_its_share_and_a_turned_one_hardly():
    longer = replace(SHEET, fx=1.02 * SHEET.fx, fy=1.02 * SHEET.fy)
    assert lens_change(SHEET, longer, survey()) == pytest.approx(-0.02, abs=2e-3)
    assert lens_change(SHEET, replace(SHEET, cx=SHEET.cx + 8.0), survey()) == pytest.approx(0.0, abs=2e-3)


def test_small_changes_of_the_lens_are_thought_to_keep_the_size_and_large_ones_to_change_it():
    beliefs = [size_belief(d) for d in (0.0, 0.01, 0.03, 0.06, 0.2)]
    assert beliefs == sorted(beliefs, reverse=True)
    assert beliefs[0] == pytest.approx(0.75)
    assert beliefs[-1] < 1e-3
    assert size_belief(-0.02) == size_belief(0.02)


def test_lengths_change_as_believed_and_the_unit_of_depth_takes_the_rest():
    lens = lens_change(SHEET, found().camera, survey())
    assert lens == pytest.approx(-8.0 / 533.0, abs=3e-3)
    moved = depth_change(in_believed_unit(found(), survey()), survey())
    assert moved == pytest.approx(-size_belief(lens) * lens, abs=1e-3)


def test_all_lengths_longer_by_one_factor_leave_every_residual_as_it_was():
    vector = spoilt(fx=5.0, offset_1=0.01, scale_x=0.02, baseline_u=3.0, shift_v_px=1.0)
    other = replace(survey(), camera=camera_of(vector_of(SHEET), SHEET))
    scaled = in_unit_of_depth(with_vector(vector), other).vector
    factor = scaled[SCALE_NUMBER] / vector[SCALE_NUMBER]
    assert abs(factor - 1.0) > 1e-3
    start = start_of(other)
    T = start.T_camera_map.copy()
    T[:, :3, 3] *= factor
    as_it_was = linearised(other, vector, start)
    longer = linearised(other, scaled, replace(start, T_camera_map=T, landmarks=start.landmarks * factor))
    np.testing.assert_allclose(longer.residuals[:, :2], as_it_was.residuals[:, :2], atol=1e-12)
    np.testing.assert_allclose(factor * longer.residuals[:, 2], as_it_was.residuals[:, 2], atol=1e-12)


@pytest.mark.parametrize(("sigma", "share"), [(1e-4, 1.0), (0.01, 0.9), (0.04, 0.36), (0.5, 0.0)])
def test_motion_capture_moves_the_unit_of_depth_as_far_as_it_is_surer_than_what_was_known(sigma, share):
    kept, tied = in_unit_of_depth(found(), survey()), in_metres(found(), survey(), ScaleFit(0.97, 0.97 * sigma, 0.3))
    longer = tied.vector[SCALE_NUMBER] / kept.vector[SCALE_NUMBER] - 1.0
    whole = 1.0 / 0.97 / kept.vector[SCALE_NUMBER] - 1.0
    assert longer == pytest.approx(share * whole, abs=4e-4)
    assert tied.sigma[SCALE_NUMBER] ** -2 == pytest.approx(TUNING.prior_unit**-2 + sigma**-2)
    assert tied.shown[SCALE_NUMBER] == (sigma < 0.02)
    lens = np.arange(len(tied.vector)) < SCALE_NUMBER - 10
    np.testing.assert_array_equal(tied.vector[lens], kept.vector[lens])
