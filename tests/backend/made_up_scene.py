"""Points in front of cameras, and what exact and noisy measurements of them are."""

from dataclasses import dataclass

import numpy as np

from odom.backend.map.corners import Corners
from odom.backend.map.keyframe import Keyframe, MeasuredLandmarks
from odom.backend.map.map import Map
from odom.backend.mapping.bundle_adjustment import Bundle
from odom.backend.mapping.observations import Observations
from odom.backend.tracking.tuning import TUNING
from odom.frame import Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming, point_flow
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.images import FrameImages
from odom.frontend.features.measurement import Measurements
from odom.frontend.features.view import View
from odom.geometry import se3

NO_DEPTH = np.zeros((48, 64), np.uint16)
RAY_SIGMA, DEPTH_SIGMA = 0.5 / 525.0, 2e-3


def points_ahead(rng, n):
    rays = rng.uniform((-0.55, -0.42), (0.55, 0.42), (n, 2))
    z = rng.uniform(0.8, 4.0, (n, 1))
    return np.column_stack([rays * z, z])


def project(T_camera_map, points):
    """x/z, y/z, 1/z of points (n x 3)."""
    X = se3.apply(T_camera_map, points)
    return np.column_stack([X[:, :2] / X[:, 2:], 1.0 / X[:, 2]])


def noisy(rng, values):
    """The values with noise, and its variances as in `Measurements`."""
    n = len(values)
    return values + rng.normal(size=(n, 3)) * [RAY_SIGMA, RAY_SIGMA, DEPTH_SIGMA], _variances(n)


def exact(values):
    """Measurements of a still camera that are as unsure as noisy ones, but true."""
    n = len(values)
    return Measurements(values, np.zeros((n, 3, 3)), _variances(n), np.zeros((n, 2)))


def _variances(n):
    """The variances of n measurements, as in `Measurements`."""
    return np.tile([RAY_SIGMA**2, 0.0, RAY_SIGMA**2, DEPTH_SIGMA**2], (n, 1))


def blank_view(number):
    """A frame that shows nothing; one comes a second."""
    images = FrameImages.of(np.zeros((48, 64), np.uint8))
    return View(number, number, Stamp(1_000_000_000 * number), SteadyStamp(0), images, Stamp(0), NO_DEPTH)


def bare_keyframe(number, T_map_camera, segment=0):
    """A key frame that measured nothing."""
    none = np.zeros(0, dtype=np.int64)
    stamp, T = Stamp(1_000_000_000 * number), se3.inverse(T_map_camera)
    return Keyframe(
        number=number,
        frame=number,
        stamp=stamp,
        segment=segment,
        first=0,
        T_camera_map=T,
        rows=none,
        identities=none,
        uv=np.zeros((0, 2)),
        measurements=Measurements.nothing(),
        timing=ShutterTiming(),
        covariance_since_start=np.zeros((6, 6)),
    )


def chain_of_keyframes(poses, covariance, begins=(0,)):
    """A map of key frames at `poses` (T_map_camera), each registered against the one before, with 20 landmarks each.

    A segment begins at each of the numbers `begins`.
    """
    map_, rng = Map(), np.random.default_rng(0)
    for number, T_map_camera in enumerate(poses):
        measured = exact(project(np.eye(4), points_ahead(rng, 20)))
        view = blank_view(number)
        keyframe = map_.add_keyframe(
            view,
            se3.inverse(T_map_camera),
            MeasuredLandmarks.nothing(),
            ShutterTiming(),
            None if number in begins else number - 1,
            np.zeros((6, 6)) if number in begins else covariance,
        )
        map_.add_corners(keyframe, view, Corners(np.full((20, 2), 30.0), measured), np.zeros(2))
    return map_


@dataclass(frozen=True, eq=False)
class MadeUpBundle:
    """A bundle to adjust, disturbed, and the truth it was made from."""

    start: Bundle
    observations: Observations
    T_camera_map: np.ndarray
    landmarks: np.ndarray
    timing_change: np.ndarray


def made_up_bundle(seed, keyframes=7, points=160, timing_change=(0.006, -0.008, 0.007), disturbed=1.0, outliers=0.0):
    rng = np.random.default_rng(seed)
    landmarks = points_ahead(rng, points)
    T = np.array([se3.exp(rng.normal(0.0, 1.0, 6) * [0.12, 0.1, 0.12, 0.06, 0.08, 0.1]) for _ in range(keyframes)])
    twists = rng.normal(0.0, 1.0, (keyframes, 6)) * [0.4, 0.4, 0.4, 0.8, 0.8, 0.8]
    numbers = [np.sort(rng.choice(keyframes, rng.integers(2, keyframes + 1), replace=False)) for _ in range(points)]
    keyframe = np.concatenate(numbers)
    landmark = np.repeat(np.arange(points), [len(n) for n in numbers])
    values, jacobians = np.empty((len(keyframe), 3)), np.zeros((len(keyframe), 3, 3))
    for o, (k, p) in enumerate(zip(keyframe, landmark, strict=True)):
        x, y, w = project(T[k], landmarks[p : p + 1])[0]
        flow = np.array(point_flow(x, y, w, twists[k]))
        jacobians[o, :, 0] = -flow * (y / 0.9)
        jacobians[o, 2, 1] = -flow[2]
        jacobians[o, 2, 2] = -flow[2] * (y / 0.9)
        values[o] = np.array([x, y, w]) - jacobians[o] @ np.array(timing_change)
    values, variances = noisy(rng, values)
    wrong = rng.random(len(values)) < outliers
    values[wrong, :2] += rng.uniform(-0.2, 0.2, (wrong.sum(), 2))
    values[rng.random(len(values)) < 0.3, 2] = np.nan
    start_T, moved = T.copy(), rng.normal(0.0, 1.0, (keyframes, 6)) * 0.01 * disturbed
    for k in range(2, keyframes):
        start_T[k] = se3.exp(moved[k]) @ T[k]
    start = Bundle(start_T, landmarks + 0.02 * disturbed * rng.normal(size=(points, 3)), np.zeros(3))
    return MadeUpBundle(
        start,
        Observations(keyframe, landmark, values, jacobians, variances),
        T,
        landmarks,
        np.array(timing_change),
    )


def robust_cost(bundle, observations, timing_information):
    """The cost that adjustment lowers, written anew: Cauchy of rays and depths, and the timing's prior."""
    o = observations
    values = o.values + o.jacobian_timing @ bundle.timing_change
    cost, cauchy = 0.0, TUNING.cauchy_chi2
    for k, p, value, (xx, xy, yy, ww) in zip(o.keyframe, o.landmark, values, o.variances, strict=True):
        x, y, w = project(bundle.T_camera_map[k], bundle.landmarks[p : p + 1])[0]
        r = value[:2] - [x, y]
        chi2 = [r @ np.linalg.solve([[xx, xy], [xy, yy]], r)]
        if value[2] > 0:
            chi2.append((value[2] - w) ** 2 / ww)
        cost += cauchy * np.log1p(np.array(chi2) / cauchy).sum()
    return cost + bundle.timing_change @ timing_information @ bundle.timing_change
