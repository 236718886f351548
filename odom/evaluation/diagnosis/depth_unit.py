"""The depth scale without truth, by the range and the depth steps of known sensors.

A structured-light sensor measures disparity in eighths of a pixel, so its depth values lie apart by a step that grows
with the square of depth, `step = k z^2`, k being a property of its optics. Depth that is scaled by s has steps `k / s
z^2`: the steps show the scale, whatever is in view.
"""

from collections.abc import Sequence

import numpy as np

from odom.evaluation.diagnosis.depth import sampled_depths, step_at
from odom.evaluation.diagnosis.finding import Finding, Verdict
from odom.frame import RgbdFrame
from odom.frame.depth_model import LIKELY_MEDIAN_M

_KINECT_STEP = 0.00286
"""k of a Kinect v1 and of every sensor with its chip and baseline, per metre: 1 / (8 * 580 px * 0.075 m). Measured on
fr1_xyz and fr1_rpy: 0.00285 to 0.0029."""
_LEVELS, _LEAST_STEP_M = 9, 0.0025
"""Depths at which the step is looked for, and the smallest that rounding to millimetres leaves readable."""
_LEAST_LEVELS, _LEAST_RANGE, _MOST_SPREAD = 3, 1.3, 1.25
"""Depths that must show the law, ratio of the farthest to the nearest, and of the largest to the smallest k: an even
step of another sensor would spread by the square of the range. Chosen on the Kinects and the HoloLens."""
_UNIT_SHARE = 0.12
"""Error of the scale, as a share, from which it is judged by the steps: devices differ by 3 %."""


def steps_scale(frames: Sequence[RgbdFrame]) -> float | None:
    """Return measured over true depth by the steps of a Kinect v1, None when the steps are not of such a sensor."""
    some = sampled_depths((frame.depth_mm for frame in frames), every=4) * 1e-3
    if not len(some):
        return None
    nearest, farthest = np.quantile(some, [0.05, 0.95])
    depths = np.geomspace(float(nearest), float(farthest), _LEVELS)
    steps = np.array([step_at(frames, depth) for depth in depths])
    seen = steps >= _LEAST_STEP_M
    depths, k = depths[seen], steps[seen] / depths[seen] ** 2
    while len(k) >= _LEAST_LEVELS and depths[-1] >= _LEAST_RANGE * depths[0]:
        if k.max() < _MOST_SPREAD * k.min():
            return float(_KINECT_STEP / np.median(k))
        depths, k = depths[1:], k[1:]  # where depth is scaled up, the nearest steps are the sensor's own rounding
    return None


def judge_unit(frames: Sequence[RgbdFrame]) -> Finding:
    """Judge the depth scale by the sensor alone; only an error of more than a tenth can be told."""
    key = "depth scale"
    some = sampled_depths(frame.depth_mm for frame in frames) * 1e-3
    ratio = steps_scale(frames)
    if ratio is not None:
        value = f"{ratio:.2f} of a Kinect v1's by the steps between depth values"
        return Finding.judged(key, value, abs(np.log(ratio)) > _UNIT_SHARE, unit_advice(ratio))
    if len(some) and not LIKELY_MEDIAN_M[0] < np.median(some) < LIKELY_MEDIAN_M[1]:
        value = f"half of the depth is within {np.median(some):.2f} m, where no known sensor has it"
        advice = "depth is in another unit: mend depth_scale in camera.yaml (units a metre), or record millimetres"
        return Finding(key, value, Verdict.BAD, advice)
    advice = "no truth, and steps of no known sensor: measure a known distance in the depth image, or record truth"
    return Finding(key, "not measured", Verdict.UNKNOWN, advice)


def unit_advice(ratio: float) -> str:
    """Return what to do about depth that is `ratio` times too large."""
    return (
        f"multiply depth by {1 / ratio:.3f}, that is depth_scale in camera.yaml (units a metre) by {ratio:.3f}, "
        "or correct the driver's unit"
    )
