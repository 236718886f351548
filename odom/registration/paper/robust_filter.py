"""RF: the robust H-infinity filter, for pairs whose noise is known and for those whose noise is not as stated."""

import math

import numpy as np

from odom.registration.checked_arrays import Arrays, checked
from odom.registration.pairs import Pairs, Prior, Registration
from odom.registration.paper.axis_bias import bias_information, possible_biases, source_noise, unbiased
from odom.registration.paper.hinfinity import affine_misfit, check_settings, discount
from odom.registration.paper.kalman_filter import solve_ungated, too_few
from odom.registration.paper.noise_adaptation import CovarianceVerdict, adapt, judge_covariances, with_noise
from odom.registration.paper.tuning import TUNING
from odom.registration.result import NoiseScale, registration_of
from odom.registration.solution import Solution, solve

_MISFIT = 33.1
"""The .99999 quantile of chi-square with 6 degrees of freedom."""


def robust(
    pairs: Pairs, prior: Prior | None = None, *, theta: float = TUNING.theta, alpha: float = 0.0, adaptive: bool = True
) -> Registration:
    """Return the motion of `pairs` by the robust H-infinity filter (eqs. 22-28) on the joint state [R | t].

    The motion is constant and known to be: A_k = I, and dA_k of eq. (24) is 0. `theta` = 1 / gamma discounts the
    information (`Y - n theta^2 I`), halved until the filter exists; it changes the covariance, not the pose (see
    `discount`). The source's noise makes the measurement matrix uncertain (eq. 25, corrected in `precisions`): by its
    exact second moment, `S_k = Sp + R Sq R'`, or with `alpha` > 0 by the norm-bounded `S_k = Sp + alpha tr(Sq) I` (eqs.
    26-27). `adaptive`: where the residuals contradict the covariances, what is wrong is learnt: a biased axis (see
    `axis_bias`), a common factor, other covariances (see `noise_adaptation`); and the result's covariance grows where
    the twelve states are no rigid motion still. `details` holds theta, gamma, alpha as used (0 where a bound was learnt
    in its place), halvings, the distance (misfit, chi-square 6) of the twelve states from the motion, and what was
    learnt. Errors and verdicts as for `kalman`, and InputError for theta or alpha that are negative or not finite.
    """
    check_settings(theta, alpha)
    arrays = checked(pairs)
    n = len(arrays.q)
    if (none := too_few(n, prior)) is not None:
        return none
    solution = solve_ungated(arrays, prior, alpha)
    details: dict[str, float] = {"alpha": alpha, "factor": 1.0, "nu": math.inf, "axis_scale": 1.0}
    noise = NoiseScale(1.0, solution.variance_factor, details)
    if solution.determined and adaptive:
        arrays, solution, noise = _learnt(arrays, prior, solution, noise)
    if solution.determined:
        steps = int(solution.sums[0])
        used, halvings = discount(solution.Y, solution.y, solution.H, steps, theta) if theta > 0.0 else (0.0, 0)
        gamma = 1.0 / used if used > 0.0 else math.inf
        details = {**noise.details, "theta": used, "gamma": gamma, "halvings": float(halvings)}
        noise = NoiseScale(noise.inflation, noise.variance_factor, details)
    return registration_of(arrays, prior, solution, noise)


def _learnt(
    arrays: Arrays, prior: Prior | None, first: Solution, noise: NoiseScale
) -> tuple[Arrays, Solution, NoiseScale]:
    """Return pairs, solution and noise after learning what is wrong: noise, then an axis, then noise again."""
    solution, noise = _noise_learnt(arrays, prior, first, noise)
    affine = solution  # weighed as a free affine map, where the source is noisy
    misfit = affine_misfit(solution.Y, solution.y, solution.T)
    if misfit > _MISFIT * noise.inflation and len(arrays.Sq):
        factor = float(noise.details["factor"])
        affine = solution._replace(Y=solution.Y - factor * source_noise(arrays.Sq, solution))
        misfit = affine_misfit(affine.Y, solution.y, solution.T) or misfit
    best = arrays, solution, noise
    if misfit > _MISFIT * noise.inflation:
        for bias in possible_biases(affine, misfit, noise.inflation):
            corrected = unbiased(arrays, bias)
            again = solve(corrected, prior, solution.T, first.weights, alpha=noise.details["alpha"])
            again, noise_again = _noise_learnt(corrected, prior, again, noise._replace(inflation=1.0))
            rest = affine_misfit(again.Y, again.y, again.T)
            if rest / noise_again.inflation < misfit / best[2].inflation:
                misfit = rest
                found = {"axis_scale": bias.scale, "axis": float(bias.axis)}
                noise_again = noise_again._replace(details={**noise_again.details, **found})
                best = corrected, again._replace(H=bias_information(again, bias)), noise_again
    arrays, solution, noise = best
    grown = misfit / 6.0 if misfit > _MISFIT * noise.inflation else noise.inflation
    return arrays, solution, NoiseScale(grown, noise.variance_factor, {**noise.details, "misfit": misfit})


def _noise_learnt(
    arrays: Arrays, prior: Prior | None, solution: Solution, noise: NoiseScale
) -> tuple[Solution, NoiseScale]:
    """Return solution and noise after learning the noise, if the residuals contradict the covariances given."""
    match judge_covariances(solution):
        case CovarianceVerdict.HOLDS:
            return solution, noise
        case CovarianceVerdict.SCALED:
            factor = solution.variance_factor
            scaled = with_noise(arrays, factor, np.zeros(3))
            again = solve(scaled, prior, solution.T, solution.weights, alpha=noise.details["alpha"])
            chi2 = factor * again.chi2  # still against what was stated
            return again._replace(chi2=chi2), noise._replace(details={**noise.details, "factor": factor})
        case CovarianceVerdict.WRONG:
            learnt = adapt(arrays, prior, solution)
            found = {"alpha": 0.0, "factor": learnt.factor, "nu": learnt.nu, "added": float(learnt.added.mean())}
            inflation = (learnt.nu + 5.0) / (learnt.nu + 3.0) if learnt.nu < math.inf else 1.0
            return learnt.solution, noise._replace(inflation=inflation, details={**noise.details, **found})
