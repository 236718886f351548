"""The simulated session, frame by frame: a pure function of its options, without any input or output."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from odom.frame import RgbdFrame, Stamp
from odom.registration.compiled import release_compiler
from odom.registration.se3 import inverse
from sensors.arena import kinect1, kinect2, room
from sensors.arena.color import picture, unpack
from sensors.arena.exposure import exposure_gain
from sensors.arena.lens import lookup, straight
from sensors.arena.noise import Tiles, frame_random, make_tiles
from sensors.arena.options import RATE_HZ, ArenaOptions, halved
from sensors.arena.render import JITTER, Renderer
from sensors.arena.shutter import READOUT_S, look_up, no_motion, row_motion
from sensors.arena.to_color import intrinsics, to_color
from sensors.arena.walk import Joined, Walk, make_walk

Array = NDArray[np.float64]

EXPOSURE_S = 0.012
"""How long the shutter is open under the lamps of a room (motion blur)."""
DEPTH_LATENCY_S = 0.009
"""How long before its stamp a depth image was seen (both Kinects)."""
MEAN_DEPTH_DELAY_S = 0.008
DEPTH_DELAY_SWING_S = 0.006
DEPTH_DELAY_PERIOD_S = 47.0


@dataclass(frozen=True, eq=False)
class ArenaFrame:
    """What the sensor delivers, and the truth: the colour camera's optical frame in the world at `stamp`.

    `rgb` H x W x 3 uint8, complete at `stamp`; `depth_mm` H x W uint16 registered to colour, stamped `depth_stamp`.
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
def _scene(name: str, seed: int) -> Renderer:
    return room.corridor(seed) if name == "corridor" else room.laboratory(seed)


def _rooms(options: ArenaOptions) -> Renderer:
    return _scene("corridor" if options.walk == "corridor" else "laboratory", options.seed)


@lru_cache(maxsize=2)
def _tiles(seed: int) -> Tiles:
    return make_tiles(seed)


def prepare(options: ArenaOptions) -> None:
    """Furnish and light the rooms of a session now instead of at its first frame, in as little memory as that takes."""
    _rooms(options)
    release_compiler()
    frame(replace(options, blackout=""), 0)
    if options.walk == "joined":
        _scene("laboratory", options.seed + 1)
    release_compiler()


def color_time(options: ArenaOptions, index: int) -> float:
    """Return when colour frame `index` is stamped, seconds since the first: when its last row was read."""
    jitter = frame_random(options.seed, index, 11).normal(0, 0.0003) if options.faults and index else 0.0
    return index / RATE_HZ + float(np.clip(jitter, -0.001, 0.001))


def depth_time(options: ArenaOptions, index: int) -> float:
    """Return when depth frame `index` is stamped: the two cameras run free, some 2 to 14 ms apart."""
    t = index / RATE_HZ
    if not options.faults:
        return t
    phase = float(np.random.default_rng([options.seed, 12]).uniform(0, 2 * np.pi))
    swing = float(np.sin(2 * np.pi * t / DEPTH_DELAY_PERIOD_S + phase))
    return t + MEAN_DEPTH_DELAY_S + DEPTH_DELAY_SWING_S * swing


def _in_blackout(options: ArenaOptions, index: int) -> bool:
    end_s = options.blackout_start_s + options.blackout_s
    return round(options.blackout_start_s * RATE_HZ) <= index < round(end_s * RATE_HZ)


def hidden(options: ArenaOptions, index: int) -> bool:
    """Tell whether frame `index` never leaves the sensor."""
    return bool(index % options.every) or (options.blackout == "frames" and _in_blackout(options, index))


def frame(options: ArenaOptions, index: int) -> ArenaFrame:
    """Return frame `index` of the session: the same bytes in whatever order frames are asked for."""
    walk = make_walk(options)
    t, t_depth = color_time(options, index), depth_time(options, index)
    dark = options.blackout if _in_blackout(options, index) else ""
    return ArenaFrame(
        index,
        Stamp(options.start + round(t * 1e6) * 1000),
        _color(options, walk, index, t, dark == "color"),
        Stamp(options.start + round(t_depth * 1e6) * 1000),
        _depth(options, walk, index, t_depth, dark == "depth"),
        walk.T_world_camera(t),
    )


def _place(options: ArenaOptions, walk: Walk, t: float) -> tuple[Renderer, Walk, float]:
    """Return the scene that is seen at `t`, and the walk and time in the scene's own world."""
    if isinstance(walk, Joined):
        if t < walk.change_s:
            return _scene("laboratory", options.seed), walk.first, t
        return _scene("laboratory", options.seed + 1), walk.second, t - walk.change_s
    return _rooms(options), walk, t


def _color(options: ArenaOptions, walk: Walk, index: int, t: float, dark: bool) -> NDArray[np.uint8]:
    """Draw the image stamped `t`."""
    t -= READOUT_S / 2 if options.faults else 0.0
    scene, walk, t = _place(options, walk, t)
    light = _light(options, scene, walk, t)
    if dark:
        light[:] = np.uint64(0)
    if not options.faults:
        return unpack(light)
    gain = exposure_gain(scene, walk, options.frames / RATE_HZ, t, options.seed)
    return picture(light, gain, _tiles(options.seed), frame_random(options.seed, index, 13))


def _light(options: ArenaOptions, scene: Renderer, walk: Walk, t: float) -> NDArray[np.uint64]:
    """Return the light on the chip (packed, see `shading.shade`), whose middle row is exposed around `t`."""
    camera, faults = options.camera, options.faults
    is_plain = not (faults or camera.distortion)
    drawn = camera if is_plain else straight(camera)
    steps = (np.arange(len(JITTER)) + 0.5) / len(JITTER) - 0.5
    blur = EXPOSURE_S if faults else 0.0
    poses = np.stack([inverse(walk.T_world_camera(t + blur * float(step))) for step in steps])
    light, inverse_depth = scene.color(poses, intrinsics(drawn), (drawn.height, drawn.width))
    if is_plain:
        return light
    motion = row_motion(walk, t, drawn, camera.height) if faults else no_motion(camera.height)
    out = np.empty((camera.height, camera.width), np.uint64)
    look_up(light, inverse_depth, lookup(camera), motion, out)
    return out


def _depth(options: ArenaOptions, walk: Walk, index: int, t: float, dark: bool) -> NDArray[np.uint16]:
    """Draw the depth image stamped `t`."""
    camera = options.camera
    if dark:
        return np.zeros((camera.height, camera.width), np.uint16)
    t -= DEPTH_LATENCY_S if options.faults else 0.0
    scene, walk, t = _place(options, walk, t)
    sensor = kinect1 if options.sensor == "kinect1" else kinect2
    infrared, T_color_infrared, shape = sensor.INFRARED, sensor.T_COLOR_INFRARED, sensor.SHAPE
    T_infrared_world = inverse(walk.T_world_camera(t) @ T_color_infrared)
    K = intrinsics(infrared)
    rng = frame_random(options.seed, index, 14)
    seen = scene.depth(T_infrared_world, K, shape)
    if not options.faults:
        depth_m = np.where(seen[0] > 0, 1 / np.maximum(seen[0], 1e-6), 0).astype(np.float32)
    elif options.sensor == "kinect1":
        depth_m = kinect1.measured_depth(*seen, scene.infrared, _tiles(options.seed), rng)
    else:
        shifted = [K - np.array([0.0, 0.0, *jitter]) for jitter in JITTER]
        samples = [scene.depth(T_infrared_world, K_k, shape) for K_k in shifted]
        depth_m = kinect2.measured_depth(seen[0], samples, scene.infrared, _tiles(options.seed), rng)
    if options.half:
        depth_m, infrared = depth_m[::2, ::2], halved(infrared, 0.0)
    return to_color(depth_m, infrared, camera, T_color_infrared)


def render_walk(options: ArenaOptions | None = None) -> Iterator[ArenaFrame]:
    """Yield the frames of a session in order, as fast as they are drawn."""
    chosen = options or ArenaOptions()
    for index in range(chosen.frames):
        if not hidden(chosen, index):
            yield frame(chosen, index)
