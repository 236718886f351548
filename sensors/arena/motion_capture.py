"""The motion capture beside the arena: a marker body on the camera, a world and a clock of its own."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.geometry.se3 import exp, so3_exp
from sensors.arena.camera_path import make_walk
from sensors.arena.noise_tiles import frame_random
from sensors.arena.options import ArenaOptions

RATE_HZ = 120.0
"""Poses a second, a common rate of OptiTrack's cameras."""
POSITION_M = 0.00025
"""Deviation of a position, each axis, metres: larger blurs the truth that results are measured by."""
ROTATION_RAD = np.deg2rad(0.04)
"""Deviation of a rotation about each axis, radians: larger blurs the directions that results are measured by."""
CLOCK_S = 0.00005
"""Deviation of its stamps, seconds: larger moves the truth along the path."""
GAP_EVERY_S = 6.0
"""Once in this many seconds the markers are hidden for 20 to 250 ms; smaller: more frames have no truth."""
MISSING = 0.004
"""Share of single poses that are missing."""


class MocapPose(NamedTuple):
    """A rigid body's pose in the motion capture's world (Y up, metres), stamped by the motion capture's clock."""

    stamp: Stamp
    T_mocap_marker: Array


@lru_cache(maxsize=4)
def T_mocap_world(seed: int) -> Array:
    """Return the arena's world (z up) in the motion capture's (y up): calibrated with a wand left on the floor."""
    rng = np.random.default_rng([seed, 21])
    T = np.eye(4)
    T[:3, :3] = so3_exp(np.array([0.0, rng.uniform(-np.pi, np.pi), 0.0])) @ [[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]]
    T[:3, 3] = rng.uniform((-1.5, -0.02, -1.5), (1.5, 0.02, 1.5))
    return T


@lru_cache(maxsize=4)
def T_camera_marker(options: ArenaOptions) -> Array:
    """Return the marker body in the colour camera's optical frame: `marker_m` and `marker_deg` away."""
    rng = np.random.default_rng([options.seed, 22])
    xi = rng.standard_normal(6)
    axis = xi[3:] / np.linalg.norm(xi[3:])
    T = np.eye(4)
    T[:3, :3] = so3_exp(axis * np.deg2rad(options.marker_deg))
    T[:3, 3] = options.marker_m * xi[:3] / np.linalg.norm(xi[:3])
    return T


def _hidden(seed: int, t: float) -> bool:
    """Say whether the markers are hidden at `t`, as they are once in each block of GAP_EVERY_S."""
    block = int(t // GAP_EVERY_S)
    rng = np.random.default_rng([seed, 23, block])
    begin, length = rng.uniform(0.5, GAP_EVERY_S - 0.5), rng.uniform(0.02, 0.25)
    return bool(begin <= t - block * GAP_EVERY_S < begin + length)


def mocap_pose(options: ArenaOptions, index: int) -> MocapPose | None:
    """Return pose `index` of the 120 a second, None when the markers were not seen."""
    t = index / RATE_HZ
    rng = frame_random(options.own_seed, index, 24)
    jitter = rng.standard_normal(7)
    if rng.random() < MISSING or _hidden(options.own_seed, t):
        return None
    wrong = exp(np.concatenate([POSITION_M * jitter[:3], ROTATION_RAD * jitter[3:6]]))
    T = T_mocap_world(options.seed) @ make_walk(options).T_world_camera(t) @ T_camera_marker(options) @ wrong
    clock = t + options.mocap_offset_s + CLOCK_S * float(np.clip(jitter[6], -3, 3))
    return MocapPose(Stamp(options.start + round(clock * 1e6) * 1000), T)
