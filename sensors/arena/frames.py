"""The simulated session, frame by frame: a pure function of its options, without any input or output."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from odom.frame import Camera, RgbdFrame, Stamp
from odom.geometry.arrays import Array, Image, Mask
from odom.geometry.se3 import inverse
from sensors.arena import kinect1, kinect2, rooms
from sensors.arena.array_types import DepthImage, Float32, Light
from sensors.arena.auto_exposure import exposure_gain
from sensors.arena.building import Building, building
from sensors.arena.camera_path import Joined, Walk, make_walk
from sensors.arena.color_chip import picture, unpack
from sensors.arena.depth_to_color import intrinsics, to_color
from sensors.arena.lens_distortion import lookup, straight
from sensors.arena.noise_tiles import Tiles, frame_random, make_tiles
from sensors.arena.options import RATE_HZ, ArenaOptions, halved
from sensors.arena.renderer import JITTER, Moments, Renderer
from sensors.arena.row_readout import READOUT_S, look_up, no_motion, row_motion

EXPOSURE_S = 0.012
"""How long the shutter is open under the lamps of a room, seconds: longer blurs more in motion."""
DEPTH_LATENCY_S = 0.009
"""How long before its stamp a depth image was seen, seconds: larger tears depth from colour in motion."""
MEAN_DEPTH_DELAY_S, DEPTH_DELAY_SWING_S, DEPTH_DELAY_PERIOD_S = 0.008, 0.006, 47.0
"""Seconds: depth is stamped the mean after colour, plus or minus the swing, which goes to and fro once in the period.

Two cameras that run free drift past each other; a mean plus swing above half a frame would pair other frames.
"""
STAMP_JITTER_S, MOST_STAMP_JITTER_S = 0.0003, 0.001
"""Deviation of colour stamps from even spacing and its bound, seconds: larger, velocities seem to shake."""


@dataclass(frozen=True, eq=False)
class ArenaFrame:
    """What the sensor delivers, and the truth: the colour camera's optical frame in the world at `stamp`.

    `rgb` H x W x 3 uint8, complete at `stamp`; `depth_mm` H x W uint16 registered to colour, stamped `depth_stamp`.
    """

    index: int
    stamp: Stamp
    rgb: Image
    depth_stamp: Stamp
    depth_mm: DepthImage
    T_world_camera: Array

    def rgbd(self) -> RgbdFrame:
        """Return the frame as the odometry takes it."""
        return RgbdFrame(self.index, self.stamp, self.rgb, self.depth_stamp, self.depth_mm)


@lru_cache(maxsize=1)
def _building(seed: int, rooms_: int, is_later: bool) -> Building:
    return building(seed, rooms_, is_later)


@lru_cache(maxsize=2)
def _scene(name: str, seed: int, people: int, is_later: bool) -> Renderer:
    return rooms.corridor(seed) if name == "corridor" else rooms.laboratory(seed, people, is_later)


@lru_cache(maxsize=2)
def _tiles(seed: int) -> Tiles:
    return make_tiles(seed)


def prepare(options: ArenaOptions) -> None:
    """Furnish and light the rooms of a session, and compile what draws them, now instead of at its first frame."""
    frame(replace(options, blackout=""), 0)
    if options.walk == "joined":
        _scene("laboratory", options.seed + 1, options.people, options.visit > 0)


def color_time(options: ArenaOptions, index: int) -> float:
    """Return when colour frame `index` is stamped, seconds since the first: when its last row was read."""
    jitter = frame_random(options.own_seed, index, 11).normal(0, STAMP_JITTER_S) if options.faults and index else 0.0
    return index / RATE_HZ + float(np.clip(jitter, -MOST_STAMP_JITTER_S, MOST_STAMP_JITTER_S))


def depth_time(options: ArenaOptions, index: int) -> float:
    """Return when depth frame `index` is stamped: the two cameras run free, some 2 to 14 ms apart."""
    t = index / RATE_HZ
    if not options.faults:
        return t
    phase = float(np.random.default_rng([options.own_seed, 12]).uniform(0, 2 * np.pi))
    swing = float(np.sin(2 * np.pi * t / DEPTH_DELAY_PERIOD_S + phase))
    return t + MEAN_DEPTH_DELAY_S + DEPTH_DELAY_SWING_S * swing


def _in_blackout(options: ArenaOptions, index: int) -> bool:
    end_s = options.blackout_start_s + options.blackout_s
    return round(options.blackout_start_s * RATE_HZ) <= index < round(end_s * RATE_HZ)


def hidden(options: ArenaOptions, index: int) -> bool:
    """Say whether frame `index` never leaves the sensor."""
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


def _place(options: ArenaOptions, walk: Walk, t: float) -> tuple[Renderer | Building, Walk, float]:
    """Return the scene that is seen at `t`, and the walk and time in the scene's own world."""
    if options.rooms:
        return _building(options.seed, options.rooms, options.visit > 0), walk, t
    if isinstance(walk, Joined) and t >= walk.change_s:
        return _scene("laboratory", options.seed + 1, options.people, options.visit > 0), walk.second, t - walk.change_s
    name = "corridor" if options.walk == "corridor" else "laboratory"
    scene = _scene(name, options.seed, options.people, options.visit > 0)
    return scene, walk.first if isinstance(walk, Joined) else walk, t


def _color(options: ArenaOptions, walk: Walk, index: int, t: float, dark: bool) -> Image:
    """Draw the image stamped `t`."""
    t -= READOUT_S / 2 if options.faults else 0.0
    place, walk, t = _place(options, walk, t)
    light = _light(options, place.near(walk.T_world_camera(t)), walk, t)
    if dark:
        light[:] = np.uint64(0)
    if not options.faults:
        return unpack(light)
    gain = exposure_gain(place, walk, options.frames / RATE_HZ, t, options.seed)
    return picture(light, gain, _tiles(options.seed), frame_random(options.own_seed, index, 13))


def _light(options: ArenaOptions, scene: Renderer, walk: Walk, t: float) -> Light:
    """Return the light on the chip, whose middle row is exposed around `t`."""
    camera, faults = options.camera, options.faults
    drawn = _drawn_camera(options)
    steps = (np.arange(len(JITTER)) + 0.5) / len(JITTER) - 0.5
    blur = EXPOSURE_S if faults else 0.0
    poses = np.stack([inverse(walk.T_world_camera(t + blur * float(step))) for step in steps])
    moments = Moments(t + blur * steps, READOUT_S if faults else 0.0, camera.height)
    light, inverse_depth = scene.color(poses, intrinsics(drawn), (drawn.height, drawn.width), moments)
    return _through_the_lens(options, walk, t, light, inverse_depth) if _is_bent(options) else light


def _drawn_camera(options: ArenaOptions) -> Camera:
    """Return the camera whose picture is drawn: the chip's own where that is straight and read out at once."""
    return straight(options.camera) if _is_bent(options) else options.camera


def _is_bent(options: ArenaOptions) -> bool:
    return options.faults or options.distortion


def _through_the_lens(options: ArenaOptions, walk: Walk, t: float, light: Light, inverse_depth: Float32) -> Light:
    """Return what of the drawn picture reaches the chip, its rows read out one by one around `t`."""
    camera = options.camera
    still = no_motion(camera.height)
    motion = row_motion(walk, t, straight(camera), camera.height) if options.faults else still
    out = np.empty((camera.height, camera.width), np.uint64)
    look_up(light, inverse_depth, lookup(camera), motion, out)
    return out


def moving_mask(options: ArenaOptions, index: int) -> Mask:
    """Return which pixels of colour frame `index` (H x W) show a person, or the carton while it is being carried.

    For tests of how an odometry copes with them: no message carries it.
    """
    walk, drawn = make_walk(options), _drawn_camera(options)
    t = color_time(options, index) - (READOUT_S / 2 if options.faults else 0.0)
    place, walk, t = _place(options, walk, t)
    scene = place.near(walk.T_world_camera(t))
    moments = Moments(np.array([t]), READOUT_S if options.faults else 0.0, options.camera.height)
    T_camera_world = inverse(walk.T_world_camera(t))
    mask, inverse_depth = scene.moving(T_camera_world, intrinsics(drawn), (drawn.height, drawn.width), moments)
    if not _is_bent(options):
        return mask
    light = _through_the_lens(options, walk, t, mask.astype(np.uint64) << np.uint64(8), inverse_depth)
    return np.asarray(light >= np.uint64(128))


def _depth(options: ArenaOptions, walk: Walk, index: int, t: float, dark: bool) -> DepthImage:
    """Draw the depth image stamped `t`."""
    camera = options.camera
    if dark:
        return np.zeros((camera.height, camera.width), np.uint16)
    t -= DEPTH_LATENCY_S if options.faults else 0.0
    place, walk, t = _place(options, walk, t)
    scene = place.near(walk.T_world_camera(t))
    sensor = kinect1 if options.sensor == "kinect1" else kinect2
    infrared, K = sensor.INFRARED, intrinsics(sensor.INFRARED)
    T_infrared_world = inverse(walk.T_world_camera(t) @ sensor.T_COLOR_INFRARED)
    rng = frame_random(options.own_seed, index, 14)
    seen = scene.depth(T_infrared_world, K, sensor.SHAPE, t)
    if not options.faults:
        w = seen.inverse_depth
        depth_m = np.where(w > 0, 1 / np.maximum(w, 1e-6), 0).astype(np.float32)
    elif options.sensor == "kinect1":
        depth_m = kinect1.measured_depth(seen, scene.infrared, _tiles(options.seed), rng)
    else:
        shifted = [K - np.array([0.0, 0.0, *jitter]) for jitter in JITTER]
        samples = [scene.depth(T_infrared_world, K_k, sensor.SHAPE, t) for K_k in shifted]
        depth_m = kinect2.measured_depth(seen.inverse_depth, samples, scene.infrared, _tiles(options.seed), rng)
    if options.half:
        depth_m, infrared = depth_m[::2, ::2], halved(infrared, 0.0)
    if options.depth_scale != 1.0:
        depth_m = depth_m * np.float32(options.depth_scale)
    return to_color(depth_m, infrared, camera, np.eye(4) if options.beside else sensor.T_COLOR_INFRARED)


def render_walk(options: ArenaOptions | None = None) -> Iterator[ArenaFrame]:
    """Yield the frames of a session in order, as fast as they are drawn."""
    chosen = options or ArenaOptions()
    for index in range(chosen.frames):
        if not hidden(chosen, index):
            yield frame(chosen, index)
