"""Seeded clouds: the paper's magnitudes under several noise models, and cases with wrongly stated noise.

The magnitudes are the paper's; the rest (400 pairs, motions up to half a metre and radian) was chosen to be like two
successive looks of a hand-held Kinect.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum, unique

import numpy as np

from odom.frame import Camera
from odom.geometry.arrays import Array, Mask
from odom.geometry.se3 import apply, exp, inverse
from odom.registration import KinectV1, Pairs, back_project, point_covariances

CAMERA = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
"""Where every cloud is seen from: 640 x 480 pixels with the focal length of a Kinect v1."""
DEPTHS_M = (0.6, 4.0)
"""Nearest and farthest depth of a Kinect v1 that is of use."""
MAGNITUDES_M = {"small": (0.0001, 0.010), "average": (0.010, 0.020), "large": (0.020, 0.080)}
"""The paper's ranges of sigma; those of both Kinects are its sensors'."""

_PAIRS = 400
"""Pairs of a cloud, as many as two looks of a Kinect share corners."""


@unique
class Noise(Enum):
    """How the sigmas drawn from a magnitude's range are spread."""

    AXIS = "one sigma per axis"
    POINT = "one sigma per point and axis"
    RAY = "along the viewing ray (eqs. 20-21), 1 % across"
    KINECT = "Kinect v1 (Khoshelham)"


@dataclass(frozen=True, eq=False)
class Sample:
    """A cloud: `measured` is what the estimators are given, `true` the noise-free points with the true covariances.

    `T` is the true motion, `wrong` (n) marks the pairs that do not belong together.
    """

    T: Array
    measured: Pairs
    true: Pairs
    wrong: Mask


def clean_clouds(rng: np.random.Generator, n: int, angle_rad: float = 0.5, distance_m: float = 0.5) -> Sample:
    """Return n points spread evenly over the view volume of both cameras, and the motion between them; no noise."""
    axis = rng.normal(size=3)
    shift = rng.normal(size=3)
    xi = np.concatenate([shift / np.linalg.norm(shift) * distance_m, axis / np.linalg.norm(axis) * angle_rad])
    T = exp(xi * rng.uniform(0.0, 1.0))
    points = np.empty((0, 3))
    while len(points) < n:
        target = view_volume(rng, 4 * n)
        source = apply(inverse(T), target)
        points = np.concatenate([points, target[visible(source)]])
    target = points[:n]
    pairs = Pairs(apply(inverse(T), target), target)
    return Sample(T, pairs, pairs, np.zeros(n, dtype=np.bool_))


def view_volume(rng: np.random.Generator, n: int) -> Array:
    """Return n points evenly spread in the volume that the camera sees between the nearest and the farthest depth."""
    near, far = DEPTHS_M
    z = np.cbrt(rng.uniform(near**3, far**3, n))
    return back_project(CAMERA, rng.uniform((0.0, 0.0), (CAMERA.width, CAMERA.height), (n, 2)), z)


def visible(points: Array) -> Mask:
    """Return which points (n x 3, camera frame) lie in the view volume."""
    z = points[:, 2]
    uv = project(points)
    inside = (uv >= 0.0).all(axis=1) & (uv[:, 0] < CAMERA.width) & (uv[:, 1] < CAMERA.height)
    return np.asarray(inside & (z > DEPTHS_M[0]) & (z < DEPTHS_M[1]))


def project(points: Array) -> Array:
    """Return the pixels (n x 2) of points in the camera frame: eq. (18)."""
    z = np.where(np.abs(points[:, 2]) > 1e-6, points[:, 2], 1e-6)
    u = CAMERA.fx / z * points[:, 0] + CAMERA.cx
    v = CAMERA.fy / z * points[:, 1] + CAMERA.cy
    return np.stack([u, v], axis=1)


def covariances(rng: np.random.Generator, noise: Noise, magnitude_m: tuple[float, float], points: Array) -> Array:
    """Return the n x 3 x 3 covariances of `points` under a noise model."""
    n = len(points)
    if noise is Noise.KINECT:
        return point_covariances(KinectV1(), CAMERA, project(points), points[:, 2])
    C = np.zeros((n, 3, 3))
    if noise is Noise.RAY:
        sigma = rng.uniform(*magnitude_m, n)
        ray = points / points[:, 2:]
        C += sigma[:, None, None] ** 2 * (ray[:, :, None] * ray[:, None, :] + 1e-4 * np.eye(3))
        return C
    sigmas = rng.uniform(*magnitude_m, (1 if noise is Noise.AXIS else n, 3))
    C[:, (0, 1, 2), (0, 1, 2)] = sigmas**2
    return C


def disturbed(rng: np.random.Generator, points: Array, C: Array | None) -> Array:
    """Return the points with random noise of their covariances C (None: none)."""
    if C is None:
        return points
    return np.asarray(points + np.einsum("nij,nj->ni", np.linalg.cholesky(C), rng.normal(size=points.shape)))


def noisy(rng: np.random.Generator, clean: Sample, C_source: Array | None, C_target: Array | None) -> Sample:
    """Return the sample with noise of the given covariances, which are also those stated to the estimators."""
    q, p = clean.true.points_source, clean.true.points_target
    return replace(
        clean,
        measured=Pairs(disturbed(rng, q, C_source), disturbed(rng, p, C_target), C_source, C_target),
        true=Pairs(q, p, C_source, C_target),
    )


def cloud(seed: int, noise: Noise, magnitude: str, both: bool, n: int = _PAIRS) -> Sample:
    """Return cloud `seed` of the paper's kind: correctly stated noise on the target, or on `both` sides."""
    rng = np.random.default_rng([seed, list(Noise).index(noise), list(MAGNITUDES_M).index(magnitude), both])
    clean = clean_clouds(rng, n)
    range_m = MAGNITUDES_M[magnitude]
    C_target = covariances(rng, noise, range_m, clean.true.points_target)
    C_source = covariances(rng, noise, range_m, clean.true.points_source) if both else None
    return noisy(rng, clean, C_source, C_target)


def kinect_noise(rng: np.random.Generator, n: int) -> tuple[Sample, Array, Array]:
    """Return a clean sample and the Kinect's covariances of its source and of its target."""
    clean = clean_clouds(rng, n)
    C_source = covariances(rng, Noise.KINECT, (0.0, 0.0), clean.true.points_source)
    return clean, C_source, covariances(rng, Noise.KINECT, (0.0, 0.0), clean.true.points_target)


def _stated(sample: Sample, C_source: Array | None, C_target: Array | None) -> Sample:
    """Return the sample with other covariances stated than those of its noise."""
    return replace(sample, measured=replace(sample.measured, covariances_source=C_source, covariances_target=C_target))


def scaled_each(rng: np.random.Generator, n: int) -> Sample:
    """Return clouds of two Kinects whose noise is, pair by pair, 0.1 to 10 times the stated sigma."""
    clean, C_source, C_target = kinect_noise(rng, n)
    factor = 10.0 ** rng.uniform(-2.0, 2.0, n)[:, None, None]
    return _stated(noisy(rng, clean, factor * C_source, factor * C_target), C_source, C_target)


def scaled_all(rng: np.random.Generator, n: int) -> Sample:
    """Return clouds of two Kinects whose noise is, for the whole cloud, 0.1 to 10 times the stated sigma."""
    clean, C_source, C_target = kinect_noise(rng, n)
    factor = 10.0 ** rng.uniform(-2.0, 2.0)
    return _stated(noisy(rng, clean, factor * C_source, factor * C_target), C_source, C_target)


def source_left_out(rng: np.random.Generator, n: int) -> Sample:
    """Return a Kinect's cloud against a surveyed one (1 mm); the noise of the source is not stated."""
    clean, C_source, _ = kinect_noise(rng, n)
    C_target = np.tile(1e-6 * np.eye(3), (n, 1, 1))
    return _stated(noisy(rng, clean, C_source, C_target), None, C_target)


def biased_axis(rng: np.random.Generator, n: int) -> Sample:
    """Return clouds of two Kinects; the target's depth axis is wrong by .5 to 2 %, which is not stated."""
    clean, C_source, C_target = kinect_noise(rng, n)
    sample = noisy(rng, clean, C_source, C_target)
    points = sample.measured.points_target.copy()
    points[:, 2] *= 1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(0.005, 0.02)
    return replace(sample, measured=replace(sample.measured, points_target=points))


def misjudged_axis(rng: np.random.Generator, n: int) -> Sample:
    """Return clouds of two Kinects with 2 cm more noise along one axis of the target, which is not stated."""
    clean, C_source, C_target = kinect_noise(rng, n)
    more = np.zeros((3, 3))
    more[(axis := rng.integers(3)), axis] = 0.02**2
    return _stated(noisy(rng, clean, C_source, C_target + more), C_source, C_target)


STRESS: dict[str, Callable[[np.random.Generator, int], Sample]] = {
    "noise of each pair x 0.1-10": scaled_each,
    "noise of all pairs x 0.1-10": scaled_all,
    "noise of the source left out": source_left_out,
    "depth axis biased by .5 to 2 %": biased_axis,
    "2 cm more along an axis": misjudged_axis,
}


def stressed(seed: int, case: str) -> Sample:
    """Return cloud `seed` of a case of wrongly stated noise."""
    return STRESS[case](np.random.default_rng([seed, 100 + list(STRESS).index(case)]), _PAIRS)


def with_outliers(seed: int, ratio: float, n: int = _PAIRS) -> Sample:
    """Return cloud `seed` of two Kinects in which a share of the pairs has its target anywhere in the view volume."""
    rng = np.random.default_rng([seed, 200, round(1000 * ratio)])
    sample = noisy(rng, *kinect_noise(rng, n))
    wrong = rng.permutation(n) < round(ratio * n)
    points, C = sample.measured.points_target.copy(), sample.measured.covariances_target
    assert C is not None
    points[wrong] = view_volume(rng, int(wrong.sum()))
    C = np.where(wrong[:, None, None], covariances(rng, Noise.KINECT, (0.0, 0.0), points), C)
    return replace(sample, wrong=wrong, measured=replace(sample.measured, points_target=points, covariances_target=C))


def nearby(seed: int) -> Sample:
    """Return cloud `seed` of two Kinects close together, the target in another order: no pair is right."""
    rng = np.random.default_rng([seed, 300])
    clean = clean_clouds(rng, _PAIRS, angle_rad=np.deg2rad(1.0), distance_m=0.03)
    C_source = covariances(rng, Noise.KINECT, (0.0, 0.0), clean.true.points_source)
    sample = noisy(rng, clean, C_source, covariances(rng, Noise.KINECT, (0.0, 0.0), clean.true.points_target))
    order = rng.permutation(_PAIRS)
    measured, C_target = sample.measured, sample.measured.covariances_target
    assert C_target is not None
    targets = measured.points_target[order]
    shuffled = replace(measured, points_target=targets, covariances_target=C_target[order])
    return replace(sample, measured=shuffled, wrong=np.ones(_PAIRS, dtype=np.bool_))
