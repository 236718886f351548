"""The simulated session, frame by frame: a pure function of its options, without any input or output."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera, RgbdFrame, Stamp
from odom.registration.se3 import inverse
from sensors.arena import kinect1
from sensors.arena.color import picture
from sensors.arena.noise import Tiles, frame_random, make_tiles
from sensors.arena.options import RATE_HZ, ArenaOptions
from sensors.arena.render import Renderer
from sensors.arena.room import laboratory, renderer
from sensors.arena.walk import LAP_S, Infinity, Joined, Rest, Walk

Array = NDArray[np.float64]

EXPOSURE_S = 0.012
"""How long the shutter is open under the lamps of a room (motion blur)."""


@dataclass(frozen=True, eq=False)
class ArenaFrame:
    """What the sensor delivers, and the truth: the colour camera's optical frame in the world at `stamp`.

    `rgb` H x W x 3 uint8; `depth_mm` H x W uint16 registered to colour, taken at `depth_stamp`.
    """

    index: int
    stamp: Stamp
    rgb: NDArray[np.uint8]
    depth_stamp: Stamp
    depth_mm: NDArray[np.uint16]
    T_world_camera: Array

    def rgbd(self) -> RgbdFrame:
        """Return the frame as the odometry takes it."""
        return RgbdFrame(self.index, self.stamp, self.rgb, self.depth_stamp, self.depth_mm)


@lru_cache(maxsize=2)
def _laboratory(seed: int) -> Renderer:
    return renderer(*laboratory(seed), seed)


@lru_cache(maxsize=2)
def _tiles(seed: int) -> Tiles:
    return make_tiles(seed)


def make_walk(options: ArenaOptions) -> Walk:
    """Return the path that the options name."""
    infinity = Infinity(options.seed)
    if options.walk == "rest":
        return Rest(infinity.T_world_camera(2.0))
    if options.walk == "joined":
        return Joined(infinity, Infinity(options.seed + 1), LAP_S + 0.5 / RATE_HZ)
    return infinity


def color_time(options: ArenaOptions, index: int) -> float:
    """Return when colour frame `index` is taken, seconds since the first (mean of its exposure)."""
    jitter = frame_random(options.seed, index, 11).normal(0, 0.0003) if options.faults and index else 0.0
    return index / RATE_HZ + float(np.clip(jitter, -0.001, 0.001))


def depth_time(options: ArenaOptions, index: int) -> float:
    """Return when depth frame `index` is stamped: the two cameras run free, some 2 to 14 ms apart."""
    t = index / RATE_HZ
    if not options.faults:
        return t
    phase = float(np.random.default_rng([options.seed, 12]).uniform(0, 2 * np.pi))
    return t + 0.008 + 0.006 * float(np.sin(2 * np.pi * t / 47.0 + phase))


def _stamp(options: ArenaOptions, t: float) -> Stamp:
    return Stamp(options.start + round(t * 1e6) * 1000)


def frame(options: ArenaOptions, index: int) -> ArenaFrame:
    """Return frame `index` of the session: the same bytes in whatever order frames are asked for."""
    walk = make_walk(options)
    t, t_depth = color_time(options, index), depth_time(options, index)
    scene = _laboratory(options.seed)
    camera = options.camera
    rgb = _color(options, walk, scene, camera, index, t)
    depth = _depth(options, walk, scene, camera, index, t_depth + options.depth_lag_s)
    return ArenaFrame(index, _stamp(options, t), rgb, _stamp(options, t_depth), depth, walk.T_world_camera(t))


def _color(
    options: ArenaOptions, walk: Walk, scene: Renderer, camera: Camera, index: int, t: float
) -> NDArray[np.uint8]:
    K = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    blur = EXPOSURE_S if options.faults else 0.0
    times = t + blur * (np.arange(4) - 1.5) / 4
    poses = np.stack([inverse(walk.T_world_camera(float(s))) for s in times])
    light = scene.color(poses, K, (camera.height, camera.width))
    if not options.faults:
        return np.asarray((light + 128) >> 8, np.uint8)
    slow = 0.05 * np.sin(2 * np.pi * t / 23.0 + options.seed)
    warm = 0.012 * np.sin(2 * np.pi * t / 31.0)
    gain = (1 + slow + warm, 1 + slow, 1 + slow - warm)
    return picture(light, gain, _tiles(options.seed), frame_random(options.seed, index, 13))


def _depth(
    options: ArenaOptions, walk: Walk, scene: Renderer, camera: Camera, index: int, t: float
) -> NDArray[np.uint16]:
    T_world_infrared = walk.T_world_camera(t) @ kinect1.T_COLOR_INFRARED
    inverse_depth, identity, distance = scene.depth(inverse(T_world_infrared), kinect1.K, kinect1.SHAPE)
    if not options.faults:
        depth_m = np.where(inverse_depth > 0, 1 / np.maximum(inverse_depth, 1e-6), 0).astype(np.float32)
        return kinect1.registered(depth_m, camera)
    rng = frame_random(options.seed, index, 14)
    return kinect1.faulty_depth(inverse_depth, identity, distance, scene.infrared, _tiles(options.seed), rng, camera)


def render_walk(options: ArenaOptions | None = None) -> Iterator[ArenaFrame]:
    """Yield the frames of a session in order, as fast as they are drawn."""
    chosen = options or ArenaOptions()
    for index in range(chosen.frames):
        yield frame(chosen, index)
