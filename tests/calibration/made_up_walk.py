"""A walk past made-up slanted surfaces, seen by a camera whose numbers are known: what a survey would hold of it."""

import numpy as np

from odom.calibration.parameters import (
    BASELINE,
    LENS,
    NAMES,
    OFFSET,
    SCALE,
    SHIFT,
    STRETCH,
    TIMINGS,
    camera_of,
    vector_of,
)
from odom.calibration.projection import project
from odom.calibration.survey import Survey
from odom.frame import Camera
from odom.frame.depth_model import field_terms
from odom.geometry import se3

SHEET = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
PIXEL_SIGMA, DEPTH_SIGMA = 0.3, 2e-3


def spoilt(**numbers):
    """The vector of a camera that differs from SHEET by `numbers`."""
    vector = vector_of(SHEET)
    for name, value in numbers.items():
        vector[NAMES.index(name)] += value
    return vector


def turning(frames, rng):
    """T_camera_map of a camera that steps and turns to all sides, about its own axis too."""
    t = np.linspace(0, 2 * np.pi, frames)
    turns = np.column_stack([0.35 * np.sin(2 * t), 0.45 * np.sin(3 * t + 1), 0.6 * np.sin(t)])
    steps = np.column_stack([0.4 * np.sin(t), 0.25 * np.cos(2 * t), 0.5 * np.sin(2 * t + 0.5)])
    return np.array([se3.exp(np.concatenate([step, turn])) for step, turn in zip(steps, turns, strict=True)])


def straight(frames, rng):
    """T_camera_map of a camera that slides sideways and never turns."""
    T = np.tile(np.eye(4), (frames, 1, 1))
    T[:, 0, 3] = np.linspace(-0.5, 0.5, frames)
    return T


def at_rest(frames, rng):
    """T_camera_map of a camera that stands still."""
    return np.tile(np.eye(4), (frames, 1, 1))


def along_a_wall(frames, rng):
    """T_camera_map of a camera that slides along a wall, and turns about its own axis alone."""
    t = np.linspace(0, 2 * np.pi, frames)
    still = np.zeros_like(t)
    steps = np.column_stack([0.5 * np.sin(t), 0.4 * np.cos(t), still, still, still, 0.8 * np.sin(2 * t)])
    return np.array([se3.exp(step) for step in steps])


def made_up_survey(vector, walk=turning, seed=0, points=400, noise=1.0, wall=False, moving=0.0):
    """The survey by SHEET of a camera that is really `vector`, with noise as it claims; poses and points begin off.

    `wall`: all there is to see is a wall two metres away, instead of slanted surfaces at 1.2 to 3.5 m. `moving` is the
    share of the points that lie on a body, which walks a metre to the side and half a metre nearer, and turns.
    """
    rng, frames = np.random.default_rng(seed), 40
    T_camera_map = walk(frames, rng)
    X = rng.uniform((-2.2, -1.8, 1.2), (2.2, 1.8, 3.5), (points, 3))
    normal = rng.normal(size=(points, 3)) * 0.6 + (0, 0, -1)
    if wall:
        X[:, 2], normal = 2.0, np.tile([0.0, 0.0, -1.0], (points, 1))
    number, landmark = np.meshgrid(np.arange(frames), np.arange(points))
    number, landmark = number.ravel(), landmark.ravel()
    T = T_camera_map[number]
    way = np.array([se3.exp(np.array([1.0, 0.0, -0.5, 0.0, 0.3, 0.0]) * k / frames) for k in range(frames)])
    walked = way[np.where(X[landmark, 0] < np.quantile(X[:, 0], moving), number, 0)]
    at = np.einsum("nij,nj->ni", walked[:, :3, :3], X[landmark]) + walked[:, :3, 3]
    seen = np.einsum("nij,nj->ni", T[:, :3, :3], at) + T[:, :3, 3]
    ahead = seen[:, 2] > 0.5
    uv, by_direction = project(seen[:, :2] / np.where(ahead, seen[:, 2], 1.0)[:, None], vector[LENS])
    inside = (
        ahead & (uv > 8).all(axis=1) & (uv < (631, 471)).all(axis=1) & (np.abs(seen[:, :2]) < seen[:, 2:]).all(axis=1)
    )
    number, landmark, seen, uv, by_direction = (a[inside] for a in (number, landmark, seen, uv, by_direction))
    w = 1.0 / seen[:, 2]
    n = np.einsum("nij,nj->ni", T_camera_map[number][:, :3, :3], normal[landmark])
    plane = n / np.einsum("ni,ni->n", n, seen)[:, None]
    slope = np.einsum("nj,nji->ni", plane[:, :2], np.linalg.inv(by_direction))
    terms = field_terms(uv, 640, 480)
    away = noise * rng.normal(size=(frames, 6)) * 0.005
    away[0] = 0.0
    found_uv = uv + noise * PIXEL_SIGMA * rng.normal(size=uv.shape)  # where depth is read too
    shift = vector[SHIFT] + vector[BASELINE] * w[:, None] + vector[STRETCH] * (found_uv - (319.5, 239.5))
    scale = terms @ vector[SCALE]
    measured = terms @ vector[OFFSET] + scale * w + np.einsum("ni,ni->n", slope * scale[:, None], shift)
    N = len(w)
    return Survey(
        camera=camera_of(vector_of(SHEET), SHEET),
        frame=number,
        landmark=landmark,
        uv=found_uv,
        inverse_depth=measured + noise * DEPTH_SIGMA * rng.normal(size=N),
        slope=slope * scale[:, None],
        by_timing=np.zeros((N, 3, TIMINGS)),
        variance_uv=np.tile([PIXEL_SIGMA**2, 0.0, PIXEL_SIGMA**2], (N, 1)),
        variance_depth=np.full(N, DEPTH_SIGMA**2),
        is_displaced=np.zeros(N, dtype=np.bool_),
        T_camera_map=np.array([se3.exp(a) @ pose for a, pose in zip(away, T_camera_map, strict=True)]),
        landmarks=X + noise * rng.normal(size=X.shape) * 0.02,
        is_fixed=np.arange(frames) == 0,
        seconds=np.arange(frames) / 5.0,
        recording=np.zeros(frames, dtype=np.int64),
    )
