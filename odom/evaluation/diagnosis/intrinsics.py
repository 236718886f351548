"""The focal lengths of the calibration: plausible by themselves, and against those that the motion fits."""

import numpy as np

from odom.evaluation.diagnosis.finding import WITHIN_95, Finding, Verdict
from odom.evaluation.diagnosis.motion import FocalFit
from odom.frame import Camera

_FOCAL_SHARE, _FOCAL_UNSURE = 0.09, 0.05
"""Largest error of a focal length as a share of it, beside two sigma; and the scatter above which it is not judged."""
_SYSTEMATIC = 0.04
"""Systematic error that the scatter of the fit does not show, as a share (sigma): rolling shutter, unequal noise in
image and depth. Measured on fr1_xyz, fr1_rpy and the arena, where it is up to 7 %, mostly in y."""
_ASPECT, _CENTRE, _VIEW_DEG = 0.06, 0.12, (30.0, 110.0)
"""What a calibration may be without any motion: fx / fy off one, centre off the middle (shares), and view."""


def _of_another_size(camera: Camera) -> str | None:
    """Return what to do where the centre is the middle of an image of the same shape and another size, else None."""
    factors = 2.0 * camera.cx / camera.width, 2.0 * camera.cy / camera.height
    factor = sum(factors) / 2.0
    if factor <= 0.0 or abs(factor - 1.0) < 2.0 * _CENTRE or abs(factors[0] - factors[1]) > _CENTRE * factor:
        return None
    size = f"{factor * camera.width:.0f} x {factor * camera.height:.0f}"
    return (
        f"these intrinsics seem to be for images of about {size} pixels: give the calibration of this image size, or "
        f"divide fx, fy, cx and cy by {factor:.2g}"
    )


def judge_intrinsics(camera: Camera, focal: FocalFit | None, trusted: bool) -> Finding:
    """Judge the focal lengths; `focal` is what the motion fits, `trusted` that depth is registered."""
    key = "focal length"
    view = np.degrees(2 * np.arctan([camera.width / 2 / camera.fx, camera.height / 2 / camera.fy]))
    value = f"fx {camera.fx:.1f}, fy {camera.fy:.1f} px, view {view[0]:.0f} x {view[1]:.0f} deg"
    centre = np.abs([camera.cx / camera.width - 0.5, camera.cy / camera.height - 0.5]).max()
    advice = (
        "these intrinsics belong to another camera, size or crop: odom calibrate finds those of this one in a walk, "
        "where they are less than a fifth off; else calibrate with a chessboard at this image size"
    )
    if centre > _CENTRE:  # which the fit takes for true
        value = f"{value}; centre {camera.cx:.0f}, {camera.cy:.0f}"
        return Finding(key, value, Verdict.BAD, _of_another_size(camera) or advice)
    if focal is not None and focal.sigma.max() >= _FOCAL_UNSURE:
        focal = None
    if focal is not None:
        sigma = np.hypot(focal.sigma, _SYSTEMATIC)
        fitted = zip(np.array([camera.fx, camera.fy]) / focal.ratio, sigma, strict=True)
        value += (
            "; the motion fits " + " and ".join(f"{f:.0f} ± {WITHIN_95 * f * s:.0f}" for f, s in fitted) + " (95 %)"
        )
        if (np.abs(np.log(focal.ratio)) > _FOCAL_SHARE + 2 * focal.sigma).any():
            return Finding(key, value, Verdict.BAD, advice)
    if not _VIEW_DEG[0] < view.max() < _VIEW_DEG[1] or abs(camera.fx / camera.fy - 1) > _ASPECT:
        return Finding(key, value, Verdict.BAD, advice)
    if focal is None:
        why = "turn the camera more to have it measured" if trusted else "mend the registration first"
        return Finding(key, f"{value}: plausible, not measured", Verdict.UNKNOWN, why)
    return Finding(key, value, Verdict.GOOD)
