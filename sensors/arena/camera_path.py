"""Where the camera is at any time: smooth paths carried by hand, as exact functions of time."""

from collections.abc import Hashable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from odom.geometry.arrays import Array
from odom.geometry.se3 import so3_exp
from sensors.arena.options import FRAMES_PER_KEY_POSE, KEY_POSES, RATE_HZ, WALKING_M_S, ArenaOptions
from sensors.arena.ring import way

HARMONICS = 24
"""Fourier terms of a lap's course: fewer cut the eight's bends (mm at 24), more repeat what is there."""
TURN_AHEAD_S = 1.4
"""Deviation of the Gaussian (seconds) that smooths the heading: smaller turns faster than a person carries a camera."""
LAP_S = KEY_POSES * FRAMES_PER_KEY_POSE / RATE_HZ
"""Seconds of a lap of the infinity."""
JOINED_AT_S = LAP_S + 0.5 / RATE_HZ
"""When the walk through two rooms changes from one to the other, seconds: between two frames."""
LATER_VISIT_M = 17.0
"""So much later on the way round a building each visit begins."""
LATER_VISIT_S = 11.0
"""So much later on the lap each visit to a room begins."""


class Walk(Hashable, Protocol):
    """A path; equal paths have equal hashes."""

    def T_world_camera(self, t: float) -> Array:
        """Return the colour camera's optical frame in the world (z up, metres) at `t` seconds."""


def looking(position: Array, heading: float, pitch: float, roll: float = 0.0) -> Array:
    """Return T_world_camera (optical: x right, y down, z forward) of a camera that looks along heading and pitch."""
    forward = np.array([np.cos(heading) * np.cos(pitch), np.sin(heading) * np.cos(pitch), np.sin(pitch)])
    right = np.array([np.sin(heading), -np.cos(heading), 0.0])
    T = np.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2], T[:3, 3] = right, np.cross(forward, right), forward, position
    T[:3, :3] = T[:3, :3] @ so3_exp(np.array([0.0, 0.0, roll]))
    return T


@dataclass(frozen=True, eq=False)
class Shake:
    """The motion of hands and steps: six sinusoids for each degree of freedom, with whole cycles in `period_s`."""

    seed: int
    period_s: float

    @cached_property
    def _waves(self) -> tuple[Array, Array, Array]:
        rng = np.random.default_rng([self.seed, 3])
        hertz = rng.uniform(0.25, 2.2, (6, 6))
        hertz[2, 0] = 1.75
        cycles = np.maximum(1, np.round(hertz * self.period_s))
        size = np.array([0.006, 0.006, 0.007, np.deg2rad(0.45), np.deg2rad(0.45), np.deg2rad(0.5)])[:, None]
        amplitude = size * rng.uniform(0.4, 1.0, (6, 6)) / (0.5 + cycles / self.period_s)
        return cycles, amplitude, rng.uniform(0, 2 * np.pi, (6, 6))

    def __call__(self, t: float) -> Array:
        """Return (x, y, z, heading, pitch, roll) to add at `t` seconds, metres and radians."""
        cycles, amplitude, phase = self._waves
        return np.asarray((amplitude * np.sin(2 * np.pi * cycles * t / self.period_s + phase)).sum(axis=1))


@dataclass(frozen=True)
class Infinity:
    """A lying eight, walked at even speed, looking ahead and around; one lap ends exactly where it began."""

    seed: int = 1
    half_length_m: float = 1.75
    half_width_m: float = 0.8
    height_m: float = 1.28
    begun_s: float = 0.0

    @cached_property
    def _shake(self) -> Shake:
        return Shake(self.seed, LAP_S)

    @cached_property
    def _course(self) -> NDArray[np.complex128]:
        """3 x HARMONICS Fourier coefficients of x, y and heading over a lap (heading turns back as far as it turns)."""
        s = np.linspace(0, 2 * np.pi, 4001)
        x = self.half_length_m * np.sin(s)
        y = self.half_width_m * np.sin(2 * s)
        way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
        at = np.interp(np.arange(512) / 512 * way[-1], way, s)
        heading = np.unwrap(np.arctan2(2 * self.half_width_m * np.cos(2 * at), self.half_length_m * np.cos(at)))
        samples = np.stack([self.half_length_m * np.sin(at), self.half_width_m * np.sin(2 * at), heading])
        waves = np.fft.rfft(samples, axis=1)[:, :HARMONICS] / 512
        waves[:, 1:] *= 2
        waves[2] *= np.exp(-0.5 * (2 * np.pi * np.arange(HARMONICS) * TURN_AHEAD_S / LAP_S) ** 2)
        return np.asarray(waves)

    def T_world_camera(self, t: float) -> Array:
        """See Walk."""
        turn = 2 * np.pi * (t + self.begun_s) / LAP_S
        x, y, heading = (self._course * np.exp(1j * turn * np.arange(HARMONICS))).real.sum(axis=1)
        shake = self._shake(t)
        heading += 0.1 * np.sin(2 * turn + 0.4) + shake[3]
        pitch = np.deg2rad(-13 + 5 * np.sin(3 * turn + 1.0)) + shake[4]
        height = self.height_m + 0.07 * np.sin(2 * turn + 2.0)
        position = np.array([x, y, height]) + shake[:3]
        return looking(position, heading, pitch, shake[5])


@dataclass(frozen=True, eq=False)
class Rest:
    """A camera on a tripod."""

    T: Array

    def T_world_camera(self, t: float) -> Array:
        """See Walk."""
        return self.T


@dataclass(frozen=True)
class Corridor:
    """Along the x axis past identical rooms, looking at the furnished side and a little ahead."""

    seed: int = 1
    speed_m_s: float = 0.3
    y_m: float = -0.7
    height_m: float = 1.3

    @cached_property
    def _shake(self) -> Shake:
        return Shake(self.seed, 97.0)

    def T_world_camera(self, t: float) -> Array:
        """See Walk."""
        shake = self._shake(t)
        position = np.array([self.speed_m_s * t, self.y_m + 0.08 * np.sin(0.4 * t), self.height_m]) + shake[:3]
        heading = np.deg2rad(62 + 14 * np.sin(0.31 * t)) + shake[3]
        return looking(position, heading, np.deg2rad(-10 + 3 * np.sin(0.23 * t)) + shake[4], shake[5])


@dataclass(frozen=True)
class Round:
    """Round a building of so many rooms (see `ring`), looking ahead and at the furnished side; begun on the way."""

    rooms: int
    seed: int = 1
    begun_m: float = 0.0
    height_m: float = 1.3

    @cached_property
    def _shake(self) -> Shake:
        return Shake(self.seed, 97.0)

    def T_world_camera(self, t: float) -> Array:
        """See Walk."""
        shake = self._shake(t)
        (x, y), heading = way(self.rooms, self.begun_m + WALKING_M_S * t)
        heading += np.deg2rad(48 + 14 * np.sin(0.31 * t)) + shake[3]
        pitch = np.deg2rad(-8 + 3 * np.sin(0.23 * t)) + shake[4]
        return looking(np.array([x, y, self.height_m]) + shake[:3], heading, pitch, shake[5])


@dataclass(frozen=True, eq=False)
class Joined:
    """One walk, then at `change_s` another one whose world begins at `offset_m`."""

    first: Walk
    second: Walk
    change_s: float
    offset_m: tuple[float, float, float] = (20.0, 0.0, 0.0)

    def T_world_camera(self, t: float) -> Array:
        """See Walk."""
        if t < self.change_s:
            return self.first.T_world_camera(t)
        T = self.second.T_world_camera(t - self.change_s).copy()
        T[:3, 3] += self.offset_m
        return T


@lru_cache(maxsize=4)
def make_walk(options: ArenaOptions) -> Walk:
    """Return the path that the options name."""
    if options.rooms:
        return Round(options.rooms, options.own_seed, LATER_VISIT_M * options.visit)
    infinity = Infinity(options.seed) if not options.visit else _another_lap(options)
    if options.walk == "rest":
        return Rest(infinity.T_world_camera(2.0))
    if options.walk == "corridor":
        return Corridor(options.own_seed)
    if options.walk == "joined":
        return Joined(infinity, Infinity(options.seed + 1), JOINED_AT_S)
    return infinity


def _another_lap(options: ArenaOptions) -> Infinity:
    """Return the lap of a later visit: a little narrower and higher than the first one's, begun elsewhere."""
    return Infinity(options.own_seed, 1.6, 0.72, 1.36, LATER_VISIT_S * options.visit % LAP_S)
