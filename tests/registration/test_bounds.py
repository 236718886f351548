"""The bound of the default registration: any that is positive, and the covariance knows which."""

import numpy as np
import pytest
from registration_clouds import noisy_pairs

from odom.errors import InputError
from odom.geometry.se3 import inverse, log
from odom.registration import register


@pytest.mark.parametrize("bound", [0.0, -1.0, np.nan, np.inf, -np.inf])
def test_a_bound_that_is_not_finite_and_positive_is_refused(bound, rng):
    _, pairs = noisy_pairs(rng, 20)
    with pytest.raises(InputError, match="bound"):
        register(pairs, bound=bound)


@pytest.mark.parametrize("bound", [16.27, 6.0, 3.0])
def test_the_covariance_is_true_whatever_the_bound(bound):
    nees, factors = [], []
    for seed in range(200):
        T, pairs = noisy_pairs(np.random.default_rng(seed), 150, angle=0.2)
        result = register(pairs, bound=bound)
        xi = log(inverse(result.T_target_source) @ T)
        nees.append(xi @ np.linalg.solve(result.covariance, xi))
        factors.append(result.variance_factor)
    assert abs(np.mean(nees) - 6.0) < 4.0 * np.sqrt(12.0 / 200)
    assert np.mean(factors) == pytest.approx(1.0, abs=0.05)


def test_a_bound_that_hardly_any_pair_passes_gives_no_pose(rng):
    _, pairs = noisy_pairs(rng, 50)
    for bound in (1e-12, 1e-300):
        assert not register(pairs, bound=bound).ok
