"""Positions smoothed by how a camera moves: their errors differ from frame to frame, its velocity hardly does.

The prior is motion whose acceleration is white noise (Barfoot, State Estimation for Robotics, 2017, 3.4), so that the
likeliest path is a cubic smoothing spline (Reinsch, Smoothing by spline functions, 1967). The ratio of the frames'
noise to the camera's acceleration is the one that makes all positions likeliest: where frames are few or precise,
nothing moves. The noise is limited to a share of the variance that frames claim (errors of the map and the lens last):
in four frames a second, the two steps a second of a walker look like noise. A frame that claims a larger variance gives
way to its neighbours: where the camera was hardly seen, or its motion only predicted, they say where it was.
Orientation is not smoothed: by the same measure it has no noise from frame to frame.
"""

from dataclasses import replace

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded

from odom.backend.estimate import TrajectoryPose
from odom.backend.odometry.tuning import TUNING
from odom.frame import Stamp
from odom.geometry.arrays import Array

_LEAST = 30
"""Frames: fewer say too little of how the camera moves."""
_LOG_RATIOS = np.linspace(np.log(1e-6), np.log(1e6), 41)
"""Logarithms of the ratio of the acceleration's variance to the noise's, in factors of two.

The least one averages over some 30 frames, the largest one does not smooth at all."""
_SUREST, _LEAST_SURE = 0.1, 1e4
"""Least and largest variance over the usual one. The first frame of a segment has none, since it lies where it does by
definition; and beyond a hundred times the usual sigma nothing changes, but the equations lose their digits."""
_NEAREST = 1e-3
"""Share of the usual time step: closer frames count as this far apart, or the equations lose their digits."""


def smoothed(poses: tuple[TrajectoryPose, ...], variances: Array) -> tuple[TrajectoryPose, ...]:
    """Return the poses, in order of their frames, with the positions of each segment smoothed; LOST ones stay LOST.

    `variances` (N, m^2; NaN: as most) say how sure the position of each of the N poses is against the others.
    """
    out = list(poses)
    for tracked in _stretches(poses):
        if len(tracked) < _LEAST:
            continue
        seconds = (np.array([stamp for _, stamp, _ in tracked]) - tracked[0][1]) * 1e-9
        claimed = variances[[i for i, _, _ in tracked]]
        usual = _usual(claimed)
        positions = np.array([T[:3, 3] for _, _, T in tracked])
        if usual > 0.0:
            shares = np.where(np.isfinite(claimed), np.clip(claimed / usual, _SUREST, _LEAST_SURE), 1.0)
            positions = smoothed_positions(seconds, positions, shares, TUNING.noise_share * usual)
        else:
            positions = smoothed_positions(seconds, positions)
        for (i, _, T), position in zip(tracked, positions, strict=True):
            moved = T.copy()
            moved[:3, 3] = position
            out[i] = replace(out[i], T_map_camera=moved)
    return tuple(out)


def _stretches(poses: tuple[TrajectoryPose, ...]) -> list[list[tuple[int, Stamp, Array]]]:
    """Return number, stamp and T_map_camera of the tracked poses of each segment; stamps ascend within each list."""
    found: dict[tuple[int, int], list[tuple[int, Stamp, Array]]] = {}
    times = 0
    for i, pose in enumerate(poses):
        times += i > 0 and pose.stamp <= poses[i - 1].stamp
        if pose.T_map_camera is not None:
            found.setdefault((pose.segment, times), []).append((i, pose.stamp, pose.T_map_camera))
    return list(found.values())


def _usual(variances: Array) -> float:
    """Return the median of the variances that are known, 0 where none is."""
    known = variances[np.isfinite(variances)]
    return float(np.median(known)) if len(known) else 0.0


def smoothed_positions(seconds: Array, positions: Array, shares: Array | None = None, most_m2: float = np.inf) -> Array:
    """Return the likeliest positions (N x D, m) at ascending times `seconds` (N) for noisy `positions` measured there.

    The noise's variance is r `shares` (N, None: all 1), with an unknown r of at most `most_m2` (m^2). With y the
    positions, D y are their second divided differences, whose covariance is r D W D' + q G: r W the variances of the
    positions, q that of the acceleration, G the inner products of hat functions. r and q make D y likeliest; the
    smoothed positions are y - r W D' (r D W D' + q G)^-1 D y.
    """
    w = np.ones(len(positions)) if shares is None else shares
    steps = np.diff(seconds)
    usual = np.median(steps)
    h = np.maximum(steps / usual, _NEAREST)
    changes = np.diff(np.diff(positions, axis=0) / h[:, None], axis=0)  # D y
    if not changes.any():
        return positions
    before, after = 1.0 / h[:-1], 1.0 / h[1:]
    here = -(before + after)
    # D W D' (five bands) and G (three bands), their diagonals and lower bands as rows
    noise, acceleration = np.zeros((2, 3, len(changes)))
    noise[0] = before**2 * w[:-2] + here**2 * w[1:-1] + after**2 * w[2:]
    noise[1, :-1] = here[:-1] * before[1:] * w[1:-2] + after[:-1] * here[1:] * w[2:-1]
    noise[2, :-2] = after[:-2] * before[2:] * w[2:-2]
    acceleration[0] = (h[:-1] + h[1:]) / 3.0
    acceleration[1, :-1] = h[1:-1] / 6.0

    def factor_of(log_ratio: float) -> Array:
        return np.asarray(cholesky_banded(noise + np.exp(log_ratio) * acceleration, lower=True))

    def solved(factor: Array) -> Array:
        return np.asarray(cho_solve_banded((factor, True), changes))

    def unlikelihood(log_ratio: float) -> float:
        factor = factor_of(log_ratio)
        squares = float(np.vdot(changes, solved(factor)))
        if squares > changes.size * most_m2:
            return np.inf
        return float(changes.size * np.log(squares) + 2.0 * positions.shape[1] * np.log(factor[0]).sum())

    unlikelihoods = [unlikelihood(log_ratio) for log_ratio in _LOG_RATIOS]
    best = int(np.argmin(unlikelihoods))
    if unlikelihoods[best] == np.inf:
        return positions
    pulls, out = solved(factor_of(_LOG_RATIOS[best])), positions.copy()
    out[:-2] -= (w[:-2] * before)[:, None] * pulls
    out[1:-1] -= (w[1:-1] * here)[:, None] * pulls
    out[2:] -= (w[2:] * after)[:, None] * pulls
    return out
