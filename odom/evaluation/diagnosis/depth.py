"""How much depth there is, how noisy it is compared with the sensor's model, and how finely it is quantised."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from odom.evaluation.diagnosis.finding import Finding, Verdict
from odom.frame import RgbdFrame
from odom.frontend.features.sparse_depth import without_gaps
from odom.geometry.arrays import Array
from odom.geometry.normal_distribution import NORMAL_MAD
from odom.registration.noise_models import KinectV1

_LEAST_VALID = 0.3
"""Share of pixels with depth in the usual frame, below which depth is called too little."""
_PATCH_PX = 13
"""Side of a patch in which a plane is fitted: smaller ones give rough noise figures, larger ones are seldom flat."""
_MOST_RELIEF = 0.05
"""Largest distance from the plane, as a share of depth, in a patch that still counts as flat."""
_MOST_SCATTER = 6.0
"""The same as a multiple of the scatter from pixel to pixel: noise alone lies up to this far off a plane, while relief
extends over neighbouring pixels."""
_LEAST_PATCHES = 50
"""Fewer flat patches than this in all frames together say too little about the noise."""
_SECOND_DIFFERENCE_GAIN = 6.0**0.5
"""Standard deviation of the second difference (1, -2, 1) of white noise of unit variance."""
_SMOOTHEST = 0.25
"""Quantile of the patches' noise that counts as that of smooth surfaces: cloth and clutter are rougher."""
_OCCURS = 0.2
"""A depth value occurs when it is counted so many times as often as the mean: stray values are rarer."""
_MISSED = 1.6
"""A gap of so many usual ones means that a value does not occur."""
_TOO_NOISY = 3.0
"""Scatter on smooth surfaces over the sensor model's sigma."""


def sampled_depths(depths_mm: Iterable[NDArray[np.uint16]], every: int = 8) -> NDArray[np.uint16]:
    """Return the depths (mm) of depth images at every eighth pixel (or `every`-th) both ways, where there are any."""
    samples = (depth_mm[::every, ::every] for depth_mm in depths_mm)
    return np.concatenate([np.zeros(0, np.uint16), *(sample[sample > 0] for sample in samples)])


def judge_valid(frames: Sequence[RgbdFrame]) -> Finding:
    """Judge the share of pixels with depth, once gaps between them are filled as for tracking, and how far they are."""
    measured = [frame.depth_mm for frame in frames]
    used = [without_gaps(depth_mm) for depth_mm in measured]
    shares, measured_shares = (np.array([np.count_nonzero(d) / d.size for d in each]) for each in (used, measured))
    some = sampled_depths(used) * 1e-3
    if not len(some):
        advice = "the depth stream is empty: is the infrared projector covered, too near (< 0.5 m) or in sunlight?"
        return Finding("valid depth", "no pixel has depth", Verdict.BAD, advice)
    low, middle, high = np.quantile(some, [0.05, 0.5, 0.95])
    value = (
        f"{np.median(shares):.0%} of the pixels (worst frame {shares.min():.0%}), "
        f"{low:.1f} .. {high:.1f} m, half of it within {middle:.1f} m"
    )
    if np.median(measured_shares) < np.median(shares):
        value += f"; {np.median(measured_shares):.0%} are measured, and the gaps between them filled"
    advice = "too little depth: stay 0.6 .. 4 m from surfaces, out of sunlight, and away from glass and black cloth"
    return Finding.judged("valid depth", value, bool(np.median(shares) < _LEAST_VALID), advice)


def noise_ratio(depth_mm: NDArray[np.uint16]) -> Array:
    """Return, for patches of 13 x 13 pixels, the scatter about the best plane over the Kinect model's sigma.

    Patches with missing pixels or a depth range that no plane has are left out. The plane is fitted in inverse depth,
    in which planes are affine in the pixel.
    """
    rows, columns = (size // _PATCH_PX for size in depth_mm.shape)
    cut = depth_mm[: rows * _PATCH_PX, : columns * _PATCH_PX].reshape(rows, _PATCH_PX, columns, _PATCH_PX)
    flattened = cut.transpose(0, 2, 1, 3).reshape(-1, _PATCH_PX * _PATCH_PX)
    patches = flattened[(flattened > 0).all(axis=1)].astype(np.float64) * 1e-3
    grid = np.stack(np.meshgrid(np.arange(_PATCH_PX), np.arange(_PATCH_PX)), axis=-1).reshape(-1, 2) - _PATCH_PX // 2
    basis = np.column_stack([np.ones(len(grid)), grid])
    inverse_depth = 1.0 / patches
    fitted = inverse_depth @ basis @ np.linalg.inv(basis.T @ basis) @ basis.T
    z = patches.mean(axis=1)
    residual = (inverse_depth - fitted) * z[:, None] ** 2
    sigma = np.sqrt(np.square(residual).sum(axis=1) / (len(grid) - 3))
    square = residual.reshape(len(patches), _PATCH_PX, _PATCH_PX)
    rough = np.abs(np.diff(square, n=2, axis=2)).reshape(len(patches), _PATCH_PX * (_PATCH_PX - 2))
    scatter = NORMAL_MAD * np.median(rough, axis=1) / _SECOND_DIFFERENCE_GAIN
    flat = np.abs(residual).max(axis=1) < np.maximum(_MOST_RELIEF * z, _MOST_SCATTER * scatter)
    return np.asarray((sigma / KinectV1().sigmas(z)[1])[flat])


def step_at(frames: Sequence[RgbdFrame], depth_m: float) -> float:
    """Return the usual distance (m) between neighbouring depth values that occur within 5 % of `depth_m`."""
    low, high = round(950 * depth_m), round(1050 * depth_m)
    counts = np.zeros(high - low + 1, dtype=np.int64)
    for frame in frames:
        values = frame.depth_mm[(frame.depth_mm >= low) & (frame.depth_mm <= high)]
        counts += np.bincount(values - low, minlength=len(counts))
    gaps = np.diff(np.flatnonzero(counts > _OCCURS * counts.mean()))
    # the mean is finer than a millimetre; across values that do not occur the gap is twice as wide
    return float(gaps[gaps < _MISSED * np.median(gaps)].mean()) * 1e-3 if len(gaps) > 1 else float("nan")


def judge_noise(frames: Sequence[RgbdFrame]) -> Finding:
    """Judge the depth noise on smooth surfaces against that of a Kinect v1 (1.4 mm at 1 m, growing with z^2)."""
    ratios = np.concatenate([noise_ratio(frame.depth_mm) for frame in frames]) if frames else np.zeros(0)
    if len(ratios) < _LEAST_PATCHES:
        return Finding("depth noise", "too few smooth surfaces", Verdict.UNKNOWN, "look at a wall or a table once")
    typical = float(np.quantile(ratios, _SMOOTHEST))
    middle = float(np.median(sampled_depths(frame.depth_mm for frame in frames))) * 1e-3
    step = step_at(frames, middle)
    steps = f"steps of {1e3 * step:.0f} mm" if np.isfinite(step) else "no steps"
    value = f"{typical:.1f} times the Kinect model on smooth surfaces, {steps} at {middle:.1f} m"
    advice = (
        "depth is far noisier than the sensor's model: switch off interpolation, look for a second projector, "
        "sunlight or vibration, or check the depth unit"
    )
    return Finding.judged("depth noise", value, typical > _TOO_NOISY, advice)
