"""The camera's numbers come out of a made-up walk, with sigmas that hold; what a walk cannot show is left alone."""

from dataclasses import replace

import numpy as np
import pytest
from made_up_walk import SHEET, along_a_wall, at_rest, made_up_survey, spoilt, straight, turning

from odom.calibration.adjustment import FREE, Prior, System, camera_arrays, fit, start_of
from odom.calibration.linearised import chi_squared, linearised
from odom.calibration.observation_terms import whitened_terms
from odom.calibration.parameters import LENS, NAMES, TIMINGS, prior_sigma, vector_of
from odom.calibration.projection import project
from odom.calibration.result import as_measured, calibrated, judge
from odom.geometry import se3

WRONG = {
    "focal": {"fx": 20.0, "fy": -15.0},
    "centre": {"cx": 10.0, "cy": -12.0},
    "barrel": {"k1": 0.12, "k2": -0.22, "p1": 0.001, "p2": -0.001},
    "shift": {"shift_u_px": -3.0, "shift_v_px": 2.0},
    "baseline": {"baseline_u": -13.0},
    "stretch": {"stretch_u": -0.11, "stretch_v": -0.11},
    "field": {"offset_1": 0.01, "offset_x": 0.01, "scale_xx": -0.01},
}
WRONG["all"] = {name: value for numbers in WRONG.values() for name, value in numbers.items()}


@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_calibration_is_found_within_its_sigmas(kind):
    truth = spoilt(**WRONG[kind])
    found = calibrated(made_up_survey(truth), SHEET)
    off = np.abs(found.vector - truth)[TIMINGS:] / found.sigma[TIMINGS:]
    names = np.array(NAMES[TIMINGS:])
    assert names[off > 4.0].tolist() == []
    sure = dict(zip(NAMES, found.sigma, strict=True))
    assert sure["fx"] < 0.003 * 525
    assert sure["cx"] < 1.0
    assert sure["shift_u_px"] < 0.5


@pytest.mark.long
def test_sigmas_hold_over_many_walks():
    truth = spoilt(**WRONG["all"])
    off = []
    for seed in range(5):
        found = calibrated(made_up_survey(truth, seed=seed, points=250), SHEET)
        off += list(np.abs(found.vector - truth)[found.shown] / found.sigma[found.shown])
    assert np.mean(np.array(off) < 3.0) > 0.97
    assert np.mean(np.array(off) < 1.0) < 0.95  # nor are they far too wide


def test_a_straight_slide_shows_no_focal_length_and_says_what_would():
    found = calibrated(made_up_survey(spoilt(fx=15.0), straight), SHEET)
    start = vector_of(SHEET)
    k = NAMES.index("fx")
    assert not found.shown[k]
    assert found.vector[k] == start[k]
    assert found.sigma[k] == prior_sigma(SHEET)[k]
    assert any("turn the camera" in line for line in found.hidden())


def test_a_way_that_a_poor_calibration_bent_is_straightened_within_a_few_steps():
    """Landmarks left a bent way by straight lines: most steps were refused."""
    survey = made_up_survey(spoilt(fx=15.0, fy=15.0), straight, noise=0.0)
    bends = np.linspace(0.0, 0.1, len(survey.T_camera_map))[:, None] * (0.0, 0.0, 0.0, 0.3, 1.0, 0.0)
    T_bent = np.array([se3.exp(bend) for bend in bends]) @ survey.T_camera_map
    first = np.zeros(len(survey.landmarks), dtype=np.int64)
    first[survey.landmark[::-1]] = survey.frame[::-1]
    seen = [se3.apply(T, point[None])[0] for T, point in zip(survey.T_camera_map[first], survey.landmarks, strict=True)]
    there = [se3.apply(se3.inverse(T), point[None])[0] for T, point in zip(T_bent[first], seen, strict=True)]
    bent = replace(survey, T_camera_map=T_bent, landmarks=np.array(there))
    assert System.at_start(bent, FREE).cost > 1e4
    assert fit(System.at_start(bent, FREE), Prior(vector_of(SHEET), prior_sigma(SHEET)), steps=4).system.cost < 1.0


@pytest.mark.parametrize("seed", [0, 1])
def test_a_camera_at_rest_shows_no_number_of_its_lens_and_is_not_taken_for_another(seed):
    found = calibrated(made_up_survey(spoilt(fx=15.0), at_rest, seed=seed, points=100), SHEET)
    assert not found.contradicted
    assert not found.shown[LENS].any()
    np.testing.assert_array_equal(found.vector[LENS], vector_of(SHEET)[LENS])


@pytest.mark.long
@pytest.mark.parametrize("numbers", [{}, {"fx": 15.0, "baseline_u": -13.0, "offset_1": 0.01}])
def test_a_wall_shows_neither_focal_length_nor_how_depth_errs_with_range(numbers):
    survey = made_up_survey(spoilt(**numbers), along_a_wall, wall=True)
    found, start = calibrated(survey, SHEET), vector_of(SHEET)
    for name in ("fx", "fy", "shift_u_px", "shift_v_px", "baseline_u", "baseline_v", "offset_1"):
        k = NAMES.index(name)
        assert not found.shown[k], name
        assert found.vector[k] == start[k]
        assert found.sigma[k] == prior_sigma(SHEET)[k]
    assert any("from near and from far" in line for line in found.hidden())
    assert not judge(survey, found).is_better


def test_sigmas_that_are_told_allow_for_what_parts_of_a_walk_do_not_show():
    found = calibrated(made_up_survey(spoilt(fx=15.0), points=100), SHEET)
    told = as_measured(found)
    assert (told.sigma[found.shown] > found.sigma[found.shown]).all()
    np.testing.assert_array_equal(told.sigma[~found.shown], found.sigma[~found.shown])
    np.testing.assert_array_equal(told.vector, found.vector)


@pytest.mark.long
def test_a_better_calibration_is_told_from_one_that_is_no_better():
    wrong = made_up_survey(spoilt(fx=15.0, k1=0.1))
    assert judge(wrong, calibrated(wrong, SHEET)).is_better
    right = made_up_survey(vector_of(SHEET))
    good = calibrated(right, SHEET)
    assert not judge(right, good).is_better
    assert not judge(right, with_unit(good, 1.005)).is_better


def with_unit(found, unit):
    """What motion capture makes of a calibration: the unit of depth, to .3 %."""
    is_unit = np.array(NAMES) == "scale_1"
    sigma, vector = np.where(is_unit, 0.003, found.sigma), np.where(is_unit, unit, found.vector)
    return replace(found, vector=vector, sigma=sigma, shown=found.shown | is_unit)


@pytest.mark.long
def test_a_unit_that_motion_capture_mends_is_taken_though_no_image_shows_it():
    right = made_up_survey(vector_of(SHEET))
    assert judge(right, with_unit(calibrated(right, SHEET), 0.98)).is_better


def test_derivatives_of_the_projection_are_those_of_its_values():
    rng = np.random.default_rng(1)
    xy, lens = rng.uniform(-0.6, 0.6, (20, 2)), np.array([530.0, 520.0, 320.0, 240.0, 0.2, -0.5, 0.01, -0.02, 0.3])
    _, by_direction = project(xy, lens)
    for k, step in enumerate(np.eye(2) * 1e-6):
        numeric = (project(xy + step, lens)[0] - project(xy - step, lens)[0]) / 2e-6
        np.testing.assert_allclose(by_direction[:, :, k], numeric, atol=1e-4)


def terms_of(survey, vector, bundle):
    """Whitened residual and derivatives by pose, point and all numbers, of every observation."""
    out = []
    for o in range(len(survey)):
        J, P, C, r = np.zeros((3, 6)), np.zeros((3, 3)), np.zeros((3, len(NAMES))), np.zeros(3)
        T, point = bundle.T_camera_map[survey.frame[o]], bundle.landmarks[survey.landmark[o]]
        camera = camera_arrays(survey, vector)
        whitened_terms(o, T, point, camera, survey.arrays, 4.0, J, P, C, r)
        out.append((r, J, P, C))
    return [np.array(part) for part in zip(*out, strict=True)]


def test_derivatives_of_the_residuals_are_those_of_their_values_where_there_is_no_residual():
    vector = spoilt(fx=5.0, k1=0.05, shift_u_px=1.0, baseline_v=2.0, offset_1=0.003, scale_x=0.01, stretch_v=-0.1)
    survey = made_up_survey(vector, points=20, noise=0.0)
    survey.by_timing[:] = np.random.default_rng(1).normal(0.0, 0.1, survey.by_timing.shape)
    start = start_of(survey)
    r, J, P, C = terms_of(survey, vector, start)
    np.testing.assert_allclose(r, 0.0, atol=1e-5)
    step = 1e-6
    for k in range(len(NAMES)):
        ahead, back = (terms_of(survey, vector + side * np.eye(len(NAMES))[k], start)[0] for side in (step, -step))
        scale = 1.0 + np.abs(C[:, :, k]).max()
        np.testing.assert_allclose((back - ahead) / (2 * step), C[:, :, k], atol=1e-4 * scale, err_msg=NAMES[k])
    for k in range(6):
        by_pose = [
            replace(start, T_camera_map=se3.exp(side * np.eye(6)[k]) @ start.T_camera_map) for side in (step, -step)
        ]
        ahead, back = (terms_of(survey, vector, bundle)[0] for bundle in by_pose)
        np.testing.assert_allclose((back - ahead) / (2 * step), J[:, :, k], atol=0.1)
    for k in range(3):
        by_point = [replace(start, landmarks=start.landmarks + side * np.eye(3)[k]) for side in (step, -step)]
        ahead, back = (terms_of(survey, vector, bundle)[0] for bundle in by_point)
        np.testing.assert_allclose((back - ahead) / (2 * step), P[:, :, k], atol=0.1)


def test_residuals_are_those_that_are_drawn():
    vector = spoilt(fx=5.0, k1=0.05, shift_u_px=1.0, baseline_v=2.0, offset_1=0.003, scale_x=0.01, stretch_v=-0.1)
    survey = made_up_survey(vector, points=20)
    r = terms_of(survey, vector, start_of(survey))[0]
    ray, depth = chi_squared(linearised(survey, vector, start_of(survey)))
    weight = np.column_stack([1.0 + ray / 4.0, 1.0 + ray / 4.0, 1.0 + depth / 4.0])
    np.testing.assert_allclose((r**2 * weight)[:, :2].sum(axis=1), ray, rtol=1e-9)
    np.testing.assert_allclose((r**2 * weight)[:, 2], depth, rtol=1e-9)


@pytest.mark.long
def test_the_walk_that_turns_shows_more_than_the_straight_one():
    wide, narrow = (calibrated(made_up_survey(vector_of(SHEET), walk), SHEET) for walk in (turning, straight))
    assert np.count_nonzero(wide.shown) > np.count_nonzero(narrow.shown)
