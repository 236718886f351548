"""How far a calibration that somebody gives is off in general, as the walk itself tells.

A factory's sheet is off by a fraction of what an average camera's calibration is, and nobody says which of the two was
given. Nor is everything as far off: a lens with another focal length may be centred well. So the widths of the prior,
one for each kind of number, are those under which what was measured is most probable (empirical Bayes, type II maximum
likelihood: D. MacKay, "Bayesian interpolation", 1992). A good calibration then stays where it is but in the directions
that the walk shows surely, and a poor one may move freely.
"""

from dataclasses import dataclass

import numpy as np

from odom.calibration.adjustment import Fit, Prior
from odom.calibration.parameters import GROUPS, TIMINGS
from odom.calibration.tuning import TUNING
from odom.geometry.arrays import Array, Index, Mask

_HALVINGS = 7
"""Widths that are tried: from that of the prior, each half the one before it, to a hundredth."""
_SETTLED = 1e-3
"""Gain of the logarithm of the probability, below which no other widths are looked for."""
_KIND_OF = {
    "timing": "timing", "focal length": "focal length", "image centre": "image centre", "lens distortion": "bent",
    "depth shift": "beside colour", "depth baseline": "beside colour", "depth stretch": "stretched",
    "depth offset": "depth", "depth scale": "depth", "depth field": "depth",
}  # fmt: skip
"""The kind of each group's numbers: those of one kind are off alike. What a walk hardly tells apart is of one kind, or
the walk would be made to say that one of the two is right and the other is not."""
_TANGENTIAL = ("p1", "p2")
"""A kind of their own: a lens may bend much and yet sit straight before its image."""
_KINDS = np.array([
    "tangential" if name in _TANGENTIAL else _KIND_OF[group.key] for group in GROUPS for name in group.names
])  # fmt: skip


@dataclass(frozen=True, eq=False)
class Narrowed:
    """A `prior` in the widths that are most probable, as strong as the information of the fit that they come from.

    `sigma` (p) are the standard deviations of that fit's numbers under it, errors alike in all of a walk left out (see
    `as_measured`), and the doubt which widths are the right ones included.
    """

    prior: Prior
    sigma: Array


@dataclass(frozen=True, eq=False)
class _Seen:
    """Numbers of which observations say `information` (p x p), and that times their estimate: `pull` (p)."""

    information: Array
    pull: Array
    own: Array

    def under(self, halvings: Index) -> tuple[Array, Array, Array]:
        """Return what holds under m priors whose widths are halved so often (m x p).

        The logarithm of the observations' probability, up to a constant (m); the numbers' mean (m x p); their
        covariance (m x p x p).
        """
        width = self.own * 0.5**halvings
        information = self.information + width[:, :, None] ** -2.0 * np.eye(len(self.own))
        covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
        mean = covariance @ self.pull
        volume = np.linalg.slogdet(covariance)[1] - 2.0 * np.log(width).sum(axis=1)
        return 0.5 * (mean @ self.pull + volume), mean, covariance


def narrowed(prior: Prior, fitted: Fit, sigma: Array) -> Narrowed:
    """Return the prior in the widths that a fit under it makes most probable, and how sure its numbers then are.

    `sigma` (p) are the honest standard deviations of the fit's free numbers. What they exceed the plain ones by, and
    errors alike in all of a walk, the observations' information is too large by; instead of weakening all observations,
    the prior is strengthened.
    """
    free, own = fitted.free, prior.sigma[fitted.free]
    plain = np.diag(np.linalg.inv(fitted.information))
    excess = float(np.mean(sigma**2 / plain)) * TUNING.sure_measured**2
    pull = fitted.information @ (fitted.vector - prior.mean)[free] / excess
    seen = _Seen((fitted.information - np.diag(own**-2.0)) / excess, pull, own)
    kinds = [_KINDS[free] == kind for kind in dict.fromkeys(_KINDS[free[free >= TIMINGS]].tolist())]
    halvings = _most_probable(seen, kinds, free >= TIMINGS)
    strong = prior.sigma.copy()
    strong[free] = own * 0.5**halvings / np.sqrt(excess)
    sure = np.sqrt(_variance(seen, kinds, halvings)) / TUNING.sure_measured
    return Narrowed(Prior(prior.mean, strong), sure)


def _tried(kind: Mask, halvings: Index) -> Index:
    """Return each width of one kind of number (p, whether a number is of it), the others as given (_HALVINGS x p)."""
    return np.where(kind, np.arange(_HALVINGS)[:, None], halvings)


def _most_probable(seen: _Seen, kinds: list[Mask], slow: Mask) -> Index:
    """Return the halvings (p) under which the observations are most probable, found kind by kind from a common one."""
    best, halvings = -np.inf, np.zeros(len(slow), dtype=np.int64)
    while True:
        before = best
        for kind in [slow] if best == -np.inf else kinds:
            tried = _tried(kind, halvings)
            likely = seen.under(tried)[0]
            if likely.max() > best:
                best, halvings = float(likely.max()), tried[np.argmax(likely)]
        if best - before < _SETTLED:
            return halvings


def _variance(seen: _Seen, kinds: list[Mask], halvings: Index) -> Array:
    """Return the numbers' variances (p) about their mean under the widths chosen, were one kind's width another."""
    _, mean, covariance = (one[0] for one in seen.under(halvings[None]))
    variance = np.diag(covariance).copy()
    for kind in kinds:
        evidence, at, tried = seen.under(_tried(kind, halvings))
        weight = np.exp(evidence - evidence.max())
        around = np.diagonal(tried, axis1=1, axis2=2) + (at - mean) ** 2
        variance += np.maximum(weight @ around / weight.sum() - np.diag(covariance), 0.0)
    return variance
