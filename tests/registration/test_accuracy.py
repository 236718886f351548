"""What is promised of accuracy, on the benchmark's own seeded clouds."""

import numpy as np
import pytest

from odom.evaluation.paper.benchmark import ESTIMATORS, rows
from odom.evaluation.paper.bound import bound_covariance, bound_rmse
from odom.evaluation.paper.scenarios import MAGNITUDES_M, STRESS, Noise, cloud, stressed, with_outliers
from odom.geometry.se3 import apply, exp, inverse, log
from odom.registration import Pairs, register, robust

CELLS = [(m, noise, both) for m in MAGNITUDES_M for noise in (Noise.AXIS, Noise.POINT, Noise.RAY) for both in (0, 1)]
CELLS += [("small", Noise.KINECT, both) for both in (0, 1)]
FEW_CELLS = [("small", Noise.AXIS, 1), ("average", Noise.POINT, 0), ("large", Noise.RAY, 1), ("small", Noise.KINECT, 0)]
"""Each magnitude and each kind of noise once."""


@pytest.mark.parametrize(
    ("cells", "clouds"), [(FEW_CELLS, 100), pytest.param(CELLS, 200, marks=pytest.mark.long)], ids=["few", "all"]
)
def test_filters_with_true_covariances_reach_the_cramer_rao_bound_and_rf_knows_its_covariance(cells, clouds):
    nees = []
    for magnitude, noise, both in cells:
        samples = (cloud(seed, noise, magnitude, bool(both)) for seed in range(clouds))
        found = rows("", "", samples, {name: ESTIMATORS[name] for name in ("RF", "KF")})
        for row in found:
            assert row.degenerate == 0, (magnitude, noise, both)
            assert row.rmse_mm <= 1.05 * row.bound_mm, (magnitude, noise, both)
            # no estimator is better than the bound, only luckier
            assert 0.85 < row.rms_ratio < 1.1, (magnitude, noise, both)
        nees.append(found[0].nees)
    assert 5.5 <= np.mean(nees) <= 6.5
    # the mean of chi-square (6) over 200 clouds has a sigma of .245
    assert all(6.0 - 4 * 0.245 < value < 6.0 + 4 * 0.245 for value in nees), nees


@pytest.mark.parametrize("clouds", [25, pytest.param(100, marks=pytest.mark.long)])
@pytest.mark.parametrize("case", STRESS)
def test_told_wrongly_rf_is_no_worse_than_kf_near_the_best_and_knows_how_wrong_it_is(case, clouds):
    samples = (stressed(seed, case) for seed in range(clouds))
    found = {row.estimator: row for row in rows("", case, samples, ESTIMATORS)}
    assert found["RF"].degenerate == 0
    assert found["RF"].rmse_mm <= found["KF"].rmse_mm * (1.0 + 1e-9)
    assert found["RF"].rmse_mm <= 1.2 * min(row.rmse_mm for row in found.values())
    assert found["KF"].nees > 10.0, "this case does not test anything"
    assert found["RF"].nees <= 8.0


def outlier_runs(ratio, clouds):
    """Return (ok, RMSE against that of the right pairs alone, Mahalanobis distance) a run."""
    found = []
    for seed in range(clouds):
        sample = with_outliers(seed, ratio)
        result = register(sample.measured)
        if not result.ok:
            found.append((False, np.inf, 0.0))
            continue
        q, p = sample.true.points_source, sample.true.points_target
        alone = robust(sample.measured[~sample.wrong]).T_target_source
        rmse = [np.sqrt(((apply(T, q) - p) ** 2).sum(axis=1).mean()) for T in (result.T_target_source, alone)]
        xi = log(inverse(result.T_target_source) @ sample.T)
        found.append((True, rmse[0] / rmse[1], float(np.sqrt(xi @ np.linalg.solve(result.covariance, xi)))))
    return np.array(found)


MANY_CLOUDS = [
    pytest.param(ratio, clouds, marks=pytest.mark.long)
    for ratio, clouds in ((0.0, 200), (0.3, 200), (0.5, 200), (0.7, 300), (0.8, 1000))
]


@pytest.mark.parametrize(("ratio", "clouds"), [(ratio, 100) for ratio in (0.0, 0.3, 0.8)] + MANY_CLOUDS)
def test_the_gate_leaves_what_the_right_pairs_alone_would_give(ratio, clouds):
    ok, rmse, distance = outlier_runs(ratio, clouds).T
    assert np.mean((ok == 1) & (rmse <= 3.0)) >= 0.995
    assert np.mean(distance > 5.0) <= 0.001
    assert 5.0 < np.mean(distance**2) < 7.0


@pytest.mark.parametrize(
    ("ratio", "clouds"),
    [(0.95, 100), (0.98, 40), (1.0, 40)]
    + [
        pytest.param(ratio, clouds, marks=pytest.mark.long) for ratio, clouds in ((0.95, 1000), (0.98, 100), (1.0, 100))
    ],
)
def test_at_hopeless_ratios_the_answer_is_right_or_none(ratio, clouds):
    ok, _, distance = outlier_runs(ratio, clouds).T
    assert np.mean((ok == 1) & (distance > 5.0)) <= 0.001
    assert np.mean(ok) == 0.0 if ratio == 1.0 else True


def test_a_prediction_helps_and_a_wrong_one_does_not_hurt():
    from odom.registration import Prior

    for seed in range(50):
        sample = with_outliers(seed, 0.6)
        free = register(sample.measured)
        for xi in (np.full(6, 0.01), np.array([0.5, -0.3, 0.2, 0.6, -0.4, 0.3])):
            led = register(sample.measured, Prior(sample.T @ exp(xi)))
            assert led.ok
            step = log(inverse(free.T_target_source) @ led.T_target_source)
            assert step @ np.linalg.solve(free.covariance, step) < 1.0


def test_isotropic_noise_has_the_known_bound(rng):
    q = rng.uniform(-1.0, 1.0, (400, 3))
    T = exp(rng.normal(size=6))
    pairs = Pairs(q, apply(T, q), None, np.full((400, 3), 0.005**2))
    assert bound_rmse(T, pairs) == pytest.approx(0.005 * np.sqrt(6 / 400))


def test_the_bound_does_not_depend_on_which_side_is_noisy(rng):
    sample = cloud(0, Noise.POINT, "small", False)
    T, true = sample.T, sample.true
    R = T[:3, :3]
    moved = Pairs(true.points_source, true.points_target, R.T @ true.covariances_target @ R)
    np.testing.assert_allclose(bound_covariance(T, moved), bound_covariance(T, true), rtol=1e-9)


def test_the_same_seed_is_the_same_cloud():
    one, two = (cloud(3, Noise.RAY, "large", True).measured for _ in range(2))
    assert one.points_target.tobytes() == two.points_target.tobytes()
    assert one.points_source.tobytes() == two.points_source.tobytes()
