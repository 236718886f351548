"""Checks a recording's calibration on a short walk: which errors would cost accuracy, and how much."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from odom.backend import Odometry
from odom.calibration.metric_scale import metric_scale
from odom.calibration.parameters import BASELINE, NAMES, SHIFT, STRETCH, shown_by
from odom.calibration.pixel_error import stretch_px
from odom.calibration.result import Calibrated, calibrated
from odom.calibration.survey import Survey, survey_of
from odom.errors import ConfigError, InputError
from odom.evaluation.diagnosis.finding import WITHIN_95, Finding, Verdict
from odom.evaluation.diagnosis.scale import ScaleFit
from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera, RgbdFrame

_FOCAL_SHARE, _SHIFT_PX, _SCALE_SHARE = 0.01, 2.0, 0.01
"""Errors that are faults: of focal length (a share), of depth against colour (px), of the unit of depth (a share)."""
_SURELY = 2.0
"""Sigmas by which an error must lie beyond that."""
_FOCAL_FLOOR, _SHIFT_FLOOR_PX = 0.004, 0.9
"""Least sigmas that are believed after a few seconds: on fr1_xyz the focal length is 1.7 % from the benchmark's after
the first six seconds, .6 % after ten; the shift of depth differs by .9 px (standard deviation) between 17 stretches of
3.6 s."""
_UNSURE_FOCAL, _UNSURE_PX = 0.01, 2.0
"""Sigmas from which on nothing is said."""
_REMEDY = "odom calibrate SOURCE --out camera.yaml finds it in a walk of half a minute"


def examine_calibration(
    frames: Sequence[RgbdFrame],
    camera: Camera,
    truth: Mapping[str, Trajectory],
    stopped: Callable[[], bool],
) -> list[Finding]:
    """Return what an adjustment of all that the odometry measured in `frames` says of `camera`; deterministic."""
    odometry = Odometry(camera)
    for frame in frames:
        odometry.process(frame)
        if stopped():
            return []
    trajectory = Trajectory.of(odometry.finish())
    try:
        survey = survey_of(odometry)
    except (InputError, ConfigError) as error:
        return [Finding("calibration", f"not measured: {error}", Verdict.UNKNOWN)]
    return judge_survey(survey, metric_scale(trajectory, truth) if truth else None)


def judge_survey(survey: Survey, scale: ScaleFit | None = None) -> list[Finding]:
    """Return what a survey says of the camera it was measured with; `scale` is its unit against motion capture."""
    found = calibrated(survey, survey.camera)
    findings = [_judge_focal(found, survey.camera), _judge_shift(found, survey), _judge_stretch(found)]
    return findings if scale is None else [*findings, _judge_unit(scale)]


def _judge_focal(found: Calibrated, camera: Camera) -> Finding:
    key = "focal length, walk"
    at = [NAMES.index("fx"), NAMES.index("fy")]
    given = np.array([camera.fx, camera.fy])
    sigma = np.hypot(found.sigma[at] / given, _FOCAL_FLOOR)
    if not found.shown[at].all() or sigma.max() > _UNSURE_FOCAL:
        return Finding(key, "not shown", Verdict.UNKNOWN, shown_by("fx"))
    off = np.log(found.vector[at] / given)
    words = " and ".join(
        f"{value:.0f} ± {WITHIN_95 * s * f:.0f}" for value, s, f in zip(found.vector[at], sigma, given, strict=True)
    )
    value = f"{words} px (95 %), {camera.fx:.0f} and {camera.fy:.0f} given"
    worst = float(np.abs(off).max())
    advice = f"moves are off by up to {worst:.1%}, {1e3 * worst:.0f} mm a metre: {_REMEDY}"
    return Finding.judged(key, value, bool((np.abs(off) - _SURELY * sigma > _FOCAL_SHARE).any()), advice)


def _judge_shift(found: Calibrated, survey: Survey) -> Finding:
    key = "registration, walk"
    usual = float(np.nanmedian(survey.inverse_depth))
    moved = (found.vector - found.start)[SHIFT] + usual * (found.vector - found.start)[BASELINE]
    spread = np.hypot(np.minimum(found.sigma[SHIFT], usual * found.sigma[BASELINE]), _SHIFT_FLOOR_PX)
    if not (found.shown[SHIFT].all() or found.shown[BASELINE].all()) or spread.max() > _UNSURE_PX:
        return Finding(key, "not shown", Verdict.UNKNOWN, shown_by("shift_u_px"))
    value = f"colour lies {moved[0]:+.1f} px right and {moved[1]:+.1f} px below depth, at {1.0 / usual:.1f} m"
    size = float(np.linalg.norm(moved))
    aside = 1e3 * size / usual / float(found.camera.fx)
    advice = f"depth is that of a place {aside:.0f} mm aside: {_REMEDY}"
    return Finding.judged(key, value, size - _SURELY * float(spread.max()) > _SHIFT_PX, advice)


def _judge_stretch(found: Calibrated) -> Finding:
    key, camera = "registration over the image, walk", found.camera
    moved = (found.vector - found.start)[STRETCH]
    sigma_px = np.hypot(stretch_px(camera, found.sigma[STRETCH]), _SHIFT_FLOOR_PX)
    if not found.shown[STRETCH].all() or sigma_px.max() > _UNSURE_PX:
        return Finding(key, "not shown", Verdict.UNKNOWN, shown_by("stretch_u"))
    right, below = moved * ((camera.width - 1) / 2, (camera.height - 1) / 2)
    value = f"colour lies {right:+.1f} px right of depth at the right border and {below:+.1f} px below at the lower"
    total = found.vector[STRETCH]
    own = (1.0 - total) * (camera.fx, camera.fy)
    advice = (
        f"depth has focal lengths of {own[0]:.0f} and {own[1]:.0f} px, colour {camera.fx:.0f} and {camera.fy:.0f}: "
        f"have the driver register depth, or {_REMEDY}"
    )
    if (stretch_px(camera, np.abs(total)) < _SHIFT_FLOOR_PX).all():
        advice = (
            "depth has colour's focal lengths, the calibration's stretch is out of date, of depth that was not "
            f"registered: leave it out, or {_REMEDY}"
        )
    is_fault = bool((stretch_px(camera, np.abs(moved)) - _SURELY * sigma_px > _SHIFT_PX).any())
    return Finding.judged(key, value, is_fault, advice)


def _judge_unit(scale: ScaleFit) -> Finding:
    off = abs(float(np.log(scale.ratio)))
    value = f"{scale.ratio:.3f} ± {WITHIN_95 * scale.sigma:.3f} (95 %) of the way that motion capture saw"
    advice = f"all lengths are off by {off:.1%}, {1e3 * off:.0f} mm a metre: {_REMEDY}"
    return Finding.judged("depth unit, walk", value, off - _SURELY * scale.sigma / scale.ratio > _SCALE_SHARE, advice)
