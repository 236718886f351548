"""How far a calibration that somebody gives is off in general, as the walk itself tells.

A factory's sheet is off by a fraction of what an average camera's calibration is, and nobody says which of the two was
given. So the width of the prior is the one under which what was measured is most probable (empirical Bayes, type II
maximum likelihood: D. MacKay, "Bayesian interpolation", 1992). A good calibration then stays where it is but in the
directions that the walk shows surely, and a poor one may move freely.
"""

import numpy as np

from odom.calibration.adjustment import Fit, Prior
from odom.calibration.parameters import TIMINGS
from odom.geometry.arrays import Array

_HALVINGS = 7
"""Widths that are tried: from that of the prior, each half the one before it, to a hundredth."""


def narrowed(prior: Prior, fitted: Fit, sigma: Array) -> Prior:
    """Return the prior in the width that a fit under it makes most probable, as strong as the fit's information.

    `sigma` (p) are the honest standard deviations of the fit's free numbers. What they exceed the plain ones by, the
    observations' information is too large by; instead of weakening all observations, the prior is strengthened.
    """
    free, own = fitted.free, prior.sigma[fitted.free]
    plain = np.diag(np.linalg.inv(fitted.information))
    excess = float(np.mean(sigma**2 / plain))
    seen = (fitted.information - np.diag(own**-2.0)) / excess
    pull = fitted.information @ (fitted.vector - prior.mean)[free] / excess
    widths = [np.where(free < TIMINGS, own, own * 0.5**k) for k in range(_HALVINGS)]
    width = max(widths, key=lambda one: _log_evidence(seen, pull, one))
    strong = prior.sigma.copy()
    strong[free] = width / np.sqrt(excess)
    return Prior(prior.mean, strong)


def _log_evidence(seen: Array, pull: Array, width: Array) -> float:
    """Return the logarithm of the probability of observations under a prior of standard deviations `width` (p).

    `seen` (p x p) is their information, `pull` (p) that times their estimate; up to a constant.
    """
    information = seen + np.diag(width**-2.0)
    volume = np.linalg.slogdet(information)[1] + 2.0 * float(np.log(width).sum())
    return float(0.5 * pull @ np.linalg.solve(information, pull) - 0.5 * volume)
