"""Smooth trajectories, motion capture of a marker body on them, and drifting odometry."""

import numpy as np
from scipy.interpolate import CubicSpline

from odom.evaluation import Trajectory
from odom.geometry import se3
from odom.geometry.rotations import matrices_of_vectors, vectors_of

T_BODY_CAMERA = se3.exp(np.array([0.05, -0.04, 0.047, 0.3, -0.35, 0.25]))


def smooth(rng, seconds=40.0, metres=0.3, radians=0.35, knot_s=0.8):
    """A function from n seconds to n x 4 x 4 poses of a camera swung about by hand."""
    knots = np.arange(-2.0, seconds + 2.0, knot_s)
    values = rng.normal(0, [metres] * 3 + [radians] * 3, (len(knots), 6))
    spline = CubicSpline(knots, values)

    return lambda times: _poses(spline(times))


def on_a_floor(rng):
    """A function from n seconds to n x 4 x 4 poses of a robot on a flat floor, which turns about z alone."""
    pose = smooth(rng, radians=0.8)

    def flat(times):
        T = pose(times)
        T[:, :3, :3] = matrices_of_vectors(vectors_of(T[:, :3, :3]) * [0.0, 0.0, 1.0])
        T[:, 2, 3] = 0.0
        return T

    return flat


def _poses(xi):
    """Poses (n x 4 x 4) of n positions with rotation vectors."""
    T = np.tile(np.eye(4), (len(xi), 1, 1))
    T[:, :3, :3], T[:, :3, 3] = matrices_of_vectors(xi[:, 3:]), xi[:, :3]
    return T


def trajectory(pose, times, start_s=1000.0):
    stamps = np.round((start_s + np.asarray(times)) * 1e9).astype(np.int64)
    return Trajectory(stamps, pose(np.asarray(times)))


def mocap(rng, pose, seconds, rate_hz=120.0, offset_s=0.0, T_body_camera=T_BODY_CAMERA, noise_m=2e-4, noise_rad=1e-3):
    """Truth of the marker body on its own clock, `offset_s` ahead of the camera's."""
    times = np.arange(0.0, seconds, 1.0 / rate_hz) - 0.5
    T_camera_body = se3.inverse(T_body_camera)
    sigma = [noise_m] * 3 + [noise_rad] * 3
    poses = pose(times) @ T_camera_body @ _poses(rng.normal(0, sigma, (len(times), 6)))
    return Trajectory(np.round((1000.0 + times + offset_s) * 1e9).astype(np.int64), poses)


def odometry(rng, true, step_m=0.0012, step_rad=0.0006, pull=0.985, white_m=0.001, white_rad=0.001):
    """A camera trajectory in its own world with drift that loop closures keep bounded, and some white noise."""
    drift, poses = np.zeros(6), []
    T_odom_world = se3.exp(rng.normal(0, 1.0, 6))
    for T in true.T_world_body:
        drift = pull * drift + se3.adjoint(T) @ rng.normal(0, [step_m] * 3 + [step_rad] * 3)
        poses.append(T_odom_world @ se3.exp(drift) @ T @ se3.exp(rng.normal(0, [white_m] * 3 + [white_rad] * 3)))
    return Trajectory(true.stamps, np.array(poses))
