"""WICP and EM-ICP on bad input: an error of the family or the degenerate verdict, in either mode."""

from dataclasses import replace

import numpy as np
import pytest
from registration_clouds import noisy_pairs

from odom.errors import InputError
from odom.registration import Pairs, Verdict, em_icp, wicp

rivals = pytest.mark.parametrize("estimator", [wicp, em_icp])
modes = pytest.mark.parametrize("matched", [True, False])


@rivals
@modes
@pytest.mark.parametrize("variance", [0.0, -1e-4, np.nan, np.inf])
@pytest.mark.parametrize("first", [0, 4])
def test_variances_that_are_not_positive_and_finite_are_an_error(estimator, matched, variance, first, rng):
    q = rng.uniform(-1.0, 1.0, (30, 3))
    variances = np.full((30, 3), 1e-4)
    variances[first:] = variance
    with pytest.raises(InputError, match=f"pair {first}"):
        estimator(Pairs(q, q, None, variances), matched=matched)


@rivals
@modes
def test_one_axis_of_negative_variance_is_an_error(estimator, matched, rng):
    q = rng.uniform(-1.0, 1.0, (30, 3))
    variances = np.full((30, 3), 1e-4)
    variances[7, 1] = -1e-5
    with pytest.raises(InputError, match="pair 7"):
        estimator(Pairs(q, q, variances, variances), matched=matched)


@rivals
def test_points_without_noise_on_either_side_that_could_meet_are_an_error(estimator, rng):
    q = rng.uniform(-1.0, 1.0, (30, 3))
    source, target = np.full((30, 3), 1e-4), np.full((30, 3), 1e-4)
    source[3], target[5] = 0.0, 0.0
    pairs = Pairs(q, q, source, target)
    assert estimator(pairs).ok
    with pytest.raises(InputError, match="pair 3"):
        estimator(pairs, matched=False)


@rivals
@modes
@pytest.mark.parametrize("weighted", [0, 1, 2])
def test_fewer_than_three_pairs_of_weight_are_degenerate(estimator, matched, weighted, rng):
    _, pairs = noisy_pairs(rng, 40, angle=0.05)
    weights = np.zeros(40)
    weights[:weighted] = 1.0
    result = estimator(replace(pairs, weights=weights), matched=matched)
    assert result.verdict is Verdict.DEGENERATE
    assert "3" in result.reason


@modes
def test_how_far_wicps_pairs_may_lie_apart_is_judged_by_pairs_of_weight(matched, rng):
    q = rng.uniform(-1.0, 1.0, (60, 3))
    p, weights = q.copy(), np.zeros(60)
    weights[:20] = 1.0
    q[:20] += 0.02
    variances = np.full((60, 3), 1e-4)
    result = wicp(Pairs(q, p, variances, variances, weights), matched=matched)
    np.testing.assert_allclose(result.T_target_source[:3, 3], -0.02, atol=1e-6)
