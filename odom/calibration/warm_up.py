"""Compiles and loads, before a run, what its self-calibration at the end needs."""

import numpy as np

from odom.calibration.adjustment import FREE, Prior, System, fit, likely_gain, placed
from odom.calibration.parameters import TIMINGS, prior_sigma, vector_of
from odom.calibration.standard_deviations import sigmas
from odom.calibration.survey import Survey
from odom.frame import Camera


def warm_up() -> None:
    """Adjust a made-up survey of two frames."""
    camera = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
    landmarks = np.array([[x, y, 2.0 + 0.3 * x * y] for x in (-0.5, 0.0, 0.5) for y in (-0.4, 0.4)])
    N, frames = len(landmarks), 2
    T = np.tile(np.eye(4), (frames, 1, 1))
    T[1, 0, 3] = 0.1
    seen = np.repeat(landmarks, frames, axis=0) + np.tile(T[:, :3, 3], (N, 1))
    survey = Survey(
        camera=camera,
        frame=np.tile(np.arange(frames), N),
        landmark=np.repeat(np.arange(N), frames),
        uv=525.0 * seen[:, :2] / seen[:, 2:] + (319.6, 239.5),
        inverse_depth=1.0 / seen[:, 2],
        slope=np.zeros((2 * N, 2)),
        by_timing=np.zeros((2 * N, 3, TIMINGS)),
        variance_uv=np.tile([0.1, 0.0, 0.1], (2 * N, 1)),
        variance_depth=np.full(2 * N, 1e-4),
        is_displaced=np.zeros(2 * N, dtype=np.bool_),
        T_camera_map=T,
        landmarks=landmarks,
        is_fixed=np.arange(frames) == 0,
        seconds=np.arange(frames) / 5.0,
        recording=np.zeros(frames, dtype=np.int64),
    )
    prior = Prior(vector_of(camera), prior_sigma(camera))
    begin = System.at_start(survey, FREE)
    likely_gain(begin, prior)
    fitted = fit(begin, prior, steps=1)
    sigmas(fitted.system, prior)
    placed(survey, np.ones(frames, dtype=np.bool_), survey.T_camera_map, fitted, 1)
