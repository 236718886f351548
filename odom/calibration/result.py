"""A calibration from walks: what was found, how surely, and whether to use it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from odom.calibration.adjustment import FREE, Fit, Prior, System, fit
from odom.calibration.held_out import Residuals, compare, is_better, is_no_worse
from odom.calibration.linearised import chi_squared, linearised
from odom.calibration.parameters import GROUPS, NAMES, SCALE_NUMBER, camera_of, indices_of, prior_sigma, vector_of
from odom.calibration.prior_width import narrowed
from odom.calibration.standard_deviations import sigmas
from odom.calibration.survey import Survey
from odom.calibration.tuning import TUNING
from odom.frame import Camera
from odom.geometry.arrays import Array, Mask

_FOCAL = (NAMES.index("fx"), NAMES.index("fy"))
_SEVERAL = 3
"""Frames that must see a landmark for it to be judged."""
_SURELY = 3.0
"""Sigmas by which the unit of depth must be off to be mended where nothing else is."""
_STEPS_MORE = 4
"""Steps under the narrowed prior, which moves the camera by a few sigmas at most."""


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A `camera`, the standard deviations `sigma` (30) of its parameters, and which the walk has `shown` (30).

    `vector` (30) is that of the camera, and `start` the one it began with; what was not shown is as it was there, with
    the prior's sigma. `fitted` is the last adjustment, under `prior`. `contradicted`: the walk as a whole would
    determine the focal length, but its parts disagree too much: the scene moved, or the camera is not like the given
    one.
    """

    camera: Camera
    start: Array
    vector: Array
    sigma: Array
    shown: Mask
    fitted: Fit
    prior: Prior
    contradicted: bool

    @property
    def covariance(self) -> Array:
        """The covariance (p x p) of the parameters that were adjusted: the fit's, as wide as `sigma`."""
        plain = np.linalg.inv(self.fitted.information)
        wider = self.sigma[self.fitted.free] / np.sqrt(np.diag(plain))
        return np.asarray(plain * np.outer(wider, wider))

    def hidden(self) -> list[str]:
        """Return in words what the walk did not show, or hardly, and what motion would."""
        lines = []
        for group in GROUPS:
            at = indices_of(group)
            if not self.shown[at].any():
                stays = bool((self.vector[at] == self.start[at]).all())
                how = "not shown by this walk and stays as it was" if stays else "hardly shown by this walk"
                lines.append(f"{group.key} is {how}: {group.shown_by}")
        return lines


def calibrated(
    survey: Survey,
    start: Camera,
    earlier: "Calibrated | None" = None,
    stopped: Callable[[], bool] = lambda: False,
    begin: System | None = None,
) -> Calibrated:
    """Return the camera that fits a survey best; `start` is the one that was given, and the prior.

    Parameters that become hardly surer than they were before are left as they were, the others move as far as the walk
    makes it probable (see `prior_width`). `earlier` is the result of the round before: what has changed since adds to
    the sigmas. `begin` are the equations at the survey's start, where they are known. Raises ConfigError for a lens
    that cannot be calibrated.
    """
    mean, prior_s = vector_of(start), prior_sigma(start)
    given = vector_of(survey.camera)
    mean[SCALE_NUMBER] = given[SCALE_NUMBER]  # the images do not show it
    prior = Prior(mean, prior_s)
    found, contradicted = fit(begin or System.at_start(survey, FREE), prior, stopped, settled=TUNING.fit_roughly), False
    while True:
        free = found.free
        sure, enough = sigmas(found.system, prior), TUNING.shown_share * prior_s[free]
        shown = sure < enough
        plain = np.sqrt(np.diag(np.linalg.inv(found.information)))
        contradicted |= bool((~shown & (plain < enough) & np.isin(free, _FOCAL)).any())
        if shown.all() or not shown.any():
            break
        found = found.with_fixed(prior, ~shown)
    if shown.any():
        narrow = narrowed(prior, found, sure)
        prior, sure = narrow.prior, narrow.sigma
        found = fit(found.system, prior, stopped, _STEPS_MORE)
    sigma, is_shown = prior_s.copy(), np.zeros(len(NAMES), dtype=np.bool_)
    sigma[free], is_shown[free] = sure, shown
    vector = np.where(is_shown, found.vector, mean)
    if earlier is not None:
        sigma[free] = np.hypot(sigma[free], TUNING.sure_moved * np.abs(vector - earlier.vector)[free])
    return Calibrated(camera_of(vector, start), vector_of(start), vector, sigma, is_shown, found, prior, contradicted)


CONTRADICTED = (
    "parts of the walk contradict each other on the focal length: the calibration given is that of another camera, or "
    "the scene moves; give one of this camera or of an average one, or leave out what moves; odom doctor looks at both"
)


RESTLESS = (
    "{:.0%} of the landmarks stay nowhere, whatever the camera: the scene moves, or two cameras are mixed; leave out "
    "what moves, walk where nothing does, or calibrate the cameras one by one"
)


def restless_share(survey: Survey, result: Calibrated) -> float:
    """Return the share of landmarks that most frames see elsewhere than the fit puts them: they moved meanwhile.

    Even a robust fit is pulled by them. What was displaced in the run does not count: some of it is another thing that
    looks alike.
    """
    ray, _ = chi_squared(linearised(survey, result.fitted.vector, result.fitted.bundle))
    counted = survey.landmark[~survey.is_displaced]
    seen = np.bincount(counted, minlength=len(survey.landmarks))
    elsewhere = np.bincount(counted, ray[~survey.is_displaced] > TUNING.restless_chi2, minlength=len(survey.landmarks))
    return float((elsewhere > 0.5 * seen)[seen >= _SEVERAL].mean()) if (seen >= _SEVERAL).any() else 0.0


def as_measured(result: Calibrated) -> Calibrated:
    """Return a calibration whose sigmas allow for measurement errors that are the same in all of a walk.

    Patches found slightly off, or depth rounded into the colour image's pixels, err in the same way in every part of
    it, so that no comparison of the parts shows it. The unit of depth does not come from patches.
    """
    is_measured = result.shown & (np.arange(len(NAMES)) != SCALE_NUMBER)
    sigma = np.where(is_measured, TUNING.sure_measured * result.sigma, result.sigma)
    return replace(result, sigma=sigma)


@dataclass(frozen=True)
class Judgement:
    """Residuals on frames that were held out, with the camera as it was and as calibrated, and whether to use it.

    `fits` are those by both cameras to all frames.
    """

    before: Residuals
    after: Residuals
    is_better: bool
    fits: tuple[Fit, Fit]


def judge(survey: Survey, result: Calibrated, stopped: Callable[[], bool] = lambda: False) -> Judgement:
    """Return how a calibration does on frames that it is fitted without.

    The unit of length shows in no residual: with one that motion capture surely mends, it need not do better there.
    """
    (before, after), fits = compare(survey, result.start, result.fitted, result.prior, stopped)
    use = is_better(before, after) or (_mends_unit(result) and is_no_worse(before, after))
    return Judgement(before, after, use, fits)


def _mends_unit(result: Calibrated) -> bool:
    moved = abs(float((result.vector - result.start)[SCALE_NUMBER]))
    return bool(result.shown[SCALE_NUMBER]) and moved > _SURELY * float(result.sigma[SCALE_NUMBER])
