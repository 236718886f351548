"""How far a calibration that a user gives may be off, as the walk itself tells.

A factory's sheet is off by a fraction of what an average camera's calibration is, and nobody says which of the two was
given. Nor are all parameters as far off: a lens with another focal length may be centred well. So the widths of the
prior, one for each kind of parameter, are those under which what was measured is most probable (empirical Bayes, type
II maximum likelihood: D. MacKay, "Bayesian interpolation", 1992). A good calibration then moves only in the directions
that the walk shows surely, and a poor one may move freely.
"""

from dataclasses import dataclass

import numpy as np

from odom.calibration.adjustment import Fit, Prior
from odom.calibration.parameters import GROUPS, TIMINGS
from odom.calibration.tuning import TUNING
from odom.geometry.arrays import Array, Index, Mask

_HALVINGS = np.arange(-2, 7)
"""Widths that are tried: from four times that of the prior, for another make's camera, each half the one before it, to
a hundredth."""
_RARER = 2.0
"""The logarithm of how many times as rare cameras are whose parameters of one kind are off by twice as much."""
_SETTLED = 1e-3
"""Gain of the logarithm of the probability, below which no other widths are looked for."""
_KIND_OF = {
    "timing": "timing", "focal length": "focal length", "image centre": "image centre", "lens distortion": "bent",
    "depth shift": "beside colour", "depth baseline": "beside colour", "depth stretch": "stretched",
    "depth offset": "depth", "depth scale": "depth", "depth field": "depth",
}  # fmt: skip
"""The kind of each group's parameters: those of one kind share a width. What a walk hardly tells apart is of one kind,
or one of the two would be declared right and the other wrong without evidence."""
_TANGENTIAL = ("p1", "p2")
"""A kind of their own: a lens may distort much and yet be well aligned with the image."""
_KINDS = np.array([
    "tangential" if name in _TANGENTIAL else _KIND_OF[group.key] for group in GROUPS for name in group.names
])  # fmt: skip


@dataclass(frozen=True, eq=False)
class Narrowed:
    """A `prior` of the most probable widths; its information has the same excess as that of the fit (see `narrowed`).

    `sigma` (p) are the standard deviations of that fit's parameters under it. They include the uncertainty of the
    widths, but not the errors that are the same in all of a walk (see `as_measured`).
    """

    prior: Prior
    sigma: Array


@dataclass(frozen=True, eq=False)
class _Seen:
    """The observations' `information` (p x p), that times their estimate (`pull`, p), and the `own` widths (p).

    `kinds` (each p) tell which of the parameters share a width.
    """

    information: Array
    pull: Array
    own: Array
    kinds: list[Mask]

    def under(self, halvings: Index) -> tuple[Array, Array]:
        """Return the parameters' mean (m x p), covariance (m x p x p) under widths halved `halvings` (m x p) times."""
        covariance = np.asarray(np.linalg.inv(self._information(halvings)), dtype=np.float64)
        return covariance @ self.pull, covariance

    def likely(self, halvings: Index) -> Array:
        """Return the logarithm of the probability (m) of the observations and such widths, up to a constant."""
        root = np.linalg.cholesky(self._information(halvings))
        whitened = np.linalg.solve(root, self.pull[:, None])[:, :, 0]
        volume = np.log(np.diagonal(root, axis1=1, axis2=2) * self._width(halvings)).sum(axis=1)
        doublings = sum(np.maximum(-halvings[:, kind].min(axis=1), 0) for kind in self.kinds)
        return np.asarray(0.5 * (whitened**2).sum(axis=1) - volume - _RARER * doublings)

    def _width(self, halvings: Index) -> Array:
        return np.asarray(self.own * 0.5**halvings)

    def _information(self, halvings: Index) -> Array:
        return np.asarray(self.information + self._width(halvings)[:, :, None] ** -2.0 * np.eye(len(self.own)))


def narrowed(prior: Prior, fitted: Fit, sigma: Array) -> Narrowed:
    """Return the prior in the widths that a fit under it makes most probable, and how sure its parameters then are.

    `sigma` (p) are the honest standard deviations of the fit's free parameters. The observations' information is too
    large by as much as these exceed the plain ones, and by errors that are the same in all of a walk; instead of
    weakening all observations, the prior is strengthened.
    """
    free, own = fitted.free, prior.sigma[fitted.free]
    plain = np.diag(np.linalg.inv(fitted.information))
    excess = float(np.mean(sigma**2 / plain)) * TUNING.sure_measured**2
    pull = fitted.information @ (fitted.vector - prior.mean)[free] / excess
    kinds = [_KINDS[free] == kind for kind in dict.fromkeys(_KINDS[free[free >= TIMINGS]].tolist())]
    seen = _Seen((fitted.information - np.diag(own**-2.0)) / excess, pull, own, kinds)
    halvings = _most_probable(seen, free >= TIMINGS)
    strong = prior.sigma.copy()
    strong[free] = own * 0.5**halvings / np.sqrt(excess)
    sure = np.sqrt(_variance(seen, halvings)) / TUNING.sure_measured
    return Narrowed(Prior(prior.mean, strong), sure)


def _tried(kind: Mask, halvings: Index) -> Index:
    """Return each width of one kind of parameter (p, whether one is of it), the others as given (9 x p)."""
    return np.where(kind, _HALVINGS[:, None], halvings)


def _most_probable(seen: _Seen, any_kind: Mask) -> Index:
    """Return the halvings (p) under which the observations are most probable, found kind by kind from a common one."""
    best, halvings = -np.inf, np.zeros(len(any_kind), dtype=np.int64)
    while True:
        before = best
        for kind in [any_kind] if best == -np.inf else seen.kinds:
            tried = _tried(kind, halvings)
            likely = seen.likely(tried)
            if likely.max() > best:
                best, halvings = float(likely.max()), tried[np.argmax(likely)]
        if best - before < _SETTLED:
            return halvings


def _variance(seen: _Seen, halvings: Index) -> Array:
    """Return the parameters' variances (p) under the chosen widths, with what the uncertainty of each width adds."""
    mean, covariance = (one[0] for one in seen.under(halvings[None]))
    variance = np.diag(covariance).copy()
    for kind in seen.kinds:
        widths = _tried(kind, halvings)
        evidence, (at, tried) = seen.likely(widths), seen.under(widths)
        weight = np.exp(evidence - evidence.max())
        around = np.diagonal(tried, axis1=1, axis2=2) + (at - mean) ** 2
        variance += np.maximum(weight @ around / weight.sum() - np.diag(covariance), 0.0)
    return variance
