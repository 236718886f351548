"""The depth scale against truth: the distance covered according to depth, divided by the true distance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from odom.errors import InputError
from odom.evaluation.diagnosis.depth_unit import unit_advice
from odom.evaluation.diagnosis.finding import WITHIN_95, Finding, Verdict
from odom.evaluation.diagnosis.motion import PairMotion, pair_motion
from odom.evaluation.diagnosis.tracks import Tracks
from odom.evaluation.mocap_calibration import calibrate
from odom.evaluation.times import Stamps
from odom.evaluation.trajectory import Trajectory
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.geometry.normal_distribution import NORMAL_MAD

_KEY_EVERY = 10
"""Frames for which the chain of motions keeps its reference: fewer drift more, more lose the corners in common."""
_SHORTEST_M = 0.05
"""Usual displacement of a pair below which the noise of the motions hides an error of the scale."""
_GROUPS = 8
"""Groups of pairs for the jackknife: fewer make sigma rough, more miss that neighbours err together."""
_MAX_GAP_S = 0.1
"""Truth is interpolated over at most this, as in `EvaluationOptions`."""
_LEAST_CORRELATION, _MOST_TURN_SIGMA = 0.6, np.radians(3.0)
"""A marker body's calibration is used from this correlation on, and up to this uncertainty (rad) of its rotation."""
_DISPLACEMENT_SIGMA_M, _SCALE_SIGMA, _LEVER_SIGMA_M = 0.01, 10.0, 0.3
"""Noise of a measured displacement, and weak priors of scale (1) and lever arm, which keep the system solvable."""
_SHARE, _SIGMAS, _UNSURE = 0.025, 2.5, 0.012
"""Largest error of the depth scale, as a share and in sigmas; and the scatter, as a share of the ratio, above which it
is judged only when it is off by far more."""
_GROSS, _USABLE = 4.0, 0.1
"""Sigmas by which an unsure ratio is off without doubt, and the scatter above which it says nothing at all."""
_SYSTEMATIC, _AT_WORST = 0.01, 0.015
"""Systematic error of the ratio that its scatter does not show, as a share (sigma): the usual one, by which it is
judged, and the largest of any stretch, which the interval must include too. Measured where the truth is 1: .975 to .990
in the arena, .970 to 1.005 on fr1_xyz."""
_OUTLIER_SIGMAS = 3.0
"""Pairs beyond this are left out."""


@dataclass(frozen=True)
class ScaleFit:
    """Ratio of measured to true displacement, its standard deviation, and the usual true displacement of a pair (m)."""

    ratio: float
    sigma: float
    usual_m: float


def chain(tracks: Sequence[Tracks], stamps: Stamps, focal_px: Array) -> Trajectory:
    """Return the longest unbroken run of camera poses, chained by motions from one reference frame to the next."""
    best: list[tuple[int, Array]] = []
    run: list[tuple[int, Array]] = [(0, np.eye(4))]
    key, T_world_key = 0, np.eye(4)
    for k in range(1, len(tracks)):
        motion = pair_motion(tracks, key, k, focal_px)
        if motion is None and key < k - 1:
            key, T_world_key = run[-1]
            motion = pair_motion(tracks, key, k, focal_px)
        if motion is None:
            best = max(best, run, key=len)
            run, key, T_world_key = [(k, np.eye(4))], k, np.eye(4)
            continue
        run.append((k, T_world_key @ se3.inverse(motion.T_later_earlier)))
        if k - key >= _KEY_EVERY:
            key, T_world_key = run[-1]
    best = max(best, run, key=len)
    index = np.array([k for k, _ in best])
    return Trajectory(stamps[index], np.array([T for _, T in best]))


@dataclass(frozen=True, eq=False)
class BodyTruth:
    """Truth of a body on the camera's clock, the camera's rotation in it, and whether it is the camera itself."""

    truth: Trajectory
    R_body_camera: Array
    is_camera: bool


def body_truth(poses: Trajectory, truth: Trajectory, most_turn_sigma: float = _MOST_TURN_SIGMA) -> BodyTruth | None:
    """Return a marker body's truth brought to the clock of the camera, whose estimated `poses` are given.

    None when they do not determine how: the speeds do not correlate, or the camera's rotation in the body has a
    standard deviation (rad) above `most_turn_sigma`.
    """
    try:
        found = calibrate(poses, truth)
    except InputError:
        return None
    if not found.correlation >= _LEAST_CORRELATION or found.hand_eye_sigma[3:].max() > most_turn_sigma:
        return None
    return BodyTruth(truth.delayed(-found.offset_s), found.T_body_camera[:3, :3], False)


def fit_scale(motions: Sequence[PairMotion], stamps: Stamps, body: BodyTruth) -> ScaleFit | None:
    """Return the ratio of measured to true displacement over pairs of frames, None when the camera hardly moved.

    For the body's motion (R, t) and the camera's displacement m, both seen from the earlier frame,
    `m = s R_body_camera' (t + (R - 1) lever)`: linear in the scale s and s times the unknown lever arm.
    """
    earlier, later = (stamps[[getattr(m, name) for m in motions]] for name in ("earlier", "later"))
    T_earlier, valid_earlier = body.truth.at(earlier, _MAX_GAP_S)
    T_later, valid_later = body.truth.at(later, _MAX_GAP_S)
    chosen = np.flatnonzero(valid_earlier & valid_later)
    if len(chosen) < 2 * _GROUPS:
        return None
    T = se3.inverses(T_earlier[chosen]) @ T_later[chosen]
    columns = 1 if body.is_camera else 4
    A = np.concatenate([T[:, :3, 3:], T[:, :3, :3] - np.eye(3)], axis=2)[:, :, :columns]
    A = body.R_body_camera.T @ A
    m = np.array([se3.inverse(motions[k].T_later_earlier)[:3, 3] for k in chosen.tolist()])
    usual = float(np.median(np.linalg.norm(A[:, :, 0], axis=1)))
    if usual < _SHORTEST_M:
        return None
    keep = np.ones(len(m), dtype=bool)
    for _ in range(4):
        x = _solve(A[keep], m[keep])
        error = np.linalg.norm(m - A @ x, axis=1)
        keep = error <= _OUTLIER_SIGMAS * NORMAL_MAD * np.median(error) + 1e-6
    A, m = A[keep], m[keep]
    parts = np.array_split(np.arange(len(m)), _GROUPS)
    without = np.array([_solve(np.delete(A, part, axis=0), np.delete(m, part, axis=0))[0] for part in parts])
    sigma = float(np.sqrt((_GROUPS - 1) / _GROUPS * np.square(without - without.mean()).sum()))
    return ScaleFit(float(_solve(A, m)[0]), sigma, usual)


def _solve(A: Array, m: Array) -> Array:
    flat, right = A.reshape(-1, A.shape[2]), m.ravel()
    sigma = _DISPLACEMENT_SIGMA_M / np.array([_SCALE_SIGMA, *[_LEVER_SIGMA_M] * 3])[: A.shape[2]]
    return np.linalg.solve(flat.T @ flat + np.diag(np.square(sigma)), flat.T @ right)


def judge_scale(fit: ScaleFit | None, body: str) -> Finding:
    """Judge the depth scale by the truth of `body`; its scatter is taken relative to the ratio."""
    key = "depth scale"
    scatter = fit.sigma / fit.ratio if fit is not None and fit.ratio > 0 else np.inf
    if fit is None or scatter > _USABLE:
        advice = "move the camera farther, and turn it, in view of the mocap"
        return Finding(key, "not measured", Verdict.UNKNOWN, advice)
    sigma = float(np.hypot(scatter, _SYSTEMATIC))
    off = abs(float(np.log(fit.ratio)))
    within = WITHIN_95 * float(np.hypot(scatter, _AT_WORST)) * fit.ratio
    value = f"{fit.ratio:.3f} ± {within:.3f} (95 %) of the truth's ({body}), over moves of {fit.usual_m:.2f} m"
    if off > max(_SHARE, (_GROSS if scatter > _UNSURE else _SIGMAS) * sigma):
        return Finding(key, value, Verdict.BAD, unit_advice(fit.ratio))
    if scatter > _UNSURE:
        return Finding(key, value, Verdict.UNKNOWN, "too unsure: move the camera farther, and turn it")
    return Finding(key, value, Verdict.GOOD)
