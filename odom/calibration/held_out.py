"""Whether a calibration explains frames it has not seen better than the one before it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from odom.backend.mapping.bundle_adjustment import Bundle
from odom.backend.tracking.tuning import TUNING as TRACKING
from odom.calibration.adjustment import Fit, Prior, System, fit, start_of
from odom.calibration.linearised import chi_squared, linearised
from odom.calibration.parameters import TIMINGS
from odom.calibration.survey import Survey
from odom.calibration.tuning import TUNING
from odom.geometry.arrays import Array, Mask

_STRETCHES, _EVERY = 20, 4
"""The survey is cut into stretches of time, of which every fourth is held out."""
_TIMING = np.arange(TIMINGS)
_WRONG_CHI2 = 1000.0
"""Squared normalised residual (30 sigma) from which on an observation is just wrong: of a landmark behind the camera,
say, whose image a lens model can put anywhere. One such residual, 1e44, weighed as much as the frames held out."""


@dataclass(frozen=True)
class Residuals:
    """The mean robust costs of ray and depth of some observations, and their median residuals (px; 1/m)."""

    ray_cost: float
    depth_cost: float
    ray_px: float
    depth_per_m: float

    @property
    def cost(self) -> float:
        """The two costs together."""
        return self.ray_cost + self.depth_cost


def split(survey: Survey) -> Mask:
    """Return which observations (N) are held out: every other one in the stretches held out.

    None of a landmark without depth in the rest: it could be anywhere, and one alone could cost more than all others.
    """
    seconds = survey.seconds[survey.frame]
    stretch = np.floor(_STRETCHES * seconds / (survey.seconds.max() + 1e-9)).astype(np.int64)
    held = (stretch % _EVERY == _EVERY - 1) & (np.arange(len(survey)) % 2 == 1)
    placed = np.zeros(len(survey.landmarks), dtype=np.bool_)
    placed[survey.landmark[~held & np.isfinite(survey.inverse_depth)]] = True
    return np.asarray(held & placed[survey.landmark])


def compare(
    survey: Survey, before: Array, after: Fit, prior: Prior, stopped: Callable[[], bool]
) -> tuple[tuple[Residuals, Residuals], tuple[Fit, Fit]]:
    """Return the residuals on held-out observations by the camera `before` (30) and by that of the fit `after`.

    With them come the fits of both to all observations. From these, a single step leads to the fits without those held
    out: from farther away, some landmarks would not converge.
    """
    held = split(survey)
    seen, rest = survey.part(~held), survey.part(held)
    given = fit(System.of(survey, before, start_of(survey), _TIMING), prior, stopped, settled=TUNING.fit_roughly)

    def unseen(fitted: Fit) -> Residuals:
        system = System.of(seen, fitted.vector, fitted.bundle, fitted.free)
        step = np.asarray(np.linalg.solve(system.information(prior), system.pull(prior)))
        return residuals(rest, *system.stepped(step))

    return (unseen(given), unseen(after)), (given, after)


def residuals(survey: Survey, vector: Array, bundle: Bundle) -> Residuals:
    """Return the residuals of a survey at a camera's `vector` (30), poses and landmarks."""
    lines = linearised(survey, vector, bundle)
    ray, depth = (np.minimum(chi2, _WRONG_CHI2) for chi2 in chi_squared(lines))
    deep = np.isfinite(depth)
    cauchy = TRACKING.cauchy_chi2
    fx, fy = vector[TIMINGS : TIMINGS + 2]
    px = np.hypot(fx * lines.residuals[:, 0], fy * lines.residuals[:, 1])
    return Residuals(
        float(np.mean(cauchy * np.log1p(ray / cauchy))),
        float(np.mean(cauchy * np.log1p(depth[deep] / cauchy))) if deep.any() else 0.0,
        float(np.median(px)),
        float(np.median(np.abs(lines.residuals[deep, 2]))) if deep.any() else 0.0,
    )


def is_better(before: Residuals, after: Residuals) -> bool:
    """Return whether the second explains the held-out frames better: rays and depth together, and neither worse."""
    return after.cost < (1.0 - TUNING.accept_gain) * before.cost and is_no_worse(before, after)


def is_no_worse(before: Residuals, after: Residuals) -> bool:
    """Return whether the second explains rays and depth of the held-out frames as well as the first, or better."""
    most = 1.0 + TUNING.accept_gain
    return after.ray_cost < most * before.ray_cost and after.depth_cost < most * before.depth_cost
