"""A painted box seen from inside: exact images and depth of it from any pose, for tests that need no simulator."""

import math
from collections.abc import Callable
from dataclasses import astuple, dataclass, replace

import drawn
import numpy as np
from numpy.typing import NDArray

from odom.backend import OdometrySettings
from odom.frame import Camera, RgbdFrame, Stamp
from odom.frontend.camera.lens import Lens
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled

SMALL = Camera(320, 240, 262.5, 262.5, 159.5, 119.5)
START = Stamp(1_700_000_000_000_000_000)
PERIOD = 33_333_333
AT_ONCE = OdometrySettings(readout_prior_s=0.0, depth_lag_prior_s=0.0, depth_readout_prior_s=0.0)
"""What the odometry expects where it is told that images are taken all at once, as `PaintedRoom.frame` takes them."""
_BANDS = 80
"""Into so many bands of rows a rolling shutter's image is cut, each drawn at once. Of 3 rows, within which a turn of
3 rad/s moves what is seen by .1 px to both sides; edges of bands of 10 rows are off by .8 px, which tears patches."""
_SINE = np.array([(-1) ** k * np.pi ** (2 * k + 1) / math.factorial(2 * k + 1) for k in range(9)])
"""The Taylor series of sin(pi x), of the powers 1, 3, ... 17 of x: to 1e-13 where |x| is at most .5."""
_WAVES = 24
"""Plane waves with which each wall is painted."""


@compiled
def _add_waves(along: Array, across: Array, waves: Array, phases: Array, out: Array) -> None:
    """Add to `out` (n) the plane waves (m x 2, turns a metre; phases m, turns) at points of a wall (n, n; m).

    `np.cos` takes 20 ns, and a test run needs four thousand million; here a vector's worth is found at a time:
    cos(2 pi t) = 1 - 2 sin(pi t)^2, of t less its whole turns.
    """
    for k in range(len(waves)):
        for i in range(len(out)):
            t = waves[k, 0] * along[i] + waves[k, 1] * across[i] + phases[k]
            t -= np.rint(t)
            square, sine = t * t, 0.0
            for n in range(8, -1, -1):
                sine = sine * square + _SINE[n]
            sine *= t
            out[i] += 1.0 - 2.0 * sine * sine


@compiled
def _look(rays: Array, T_room_camera: Array, half_size: Array, waves: Array, phases: Array) -> tuple[Array, Array]:
    """Return the sum of the waves of what each ray (h x w x 2) meets, and its depth (m).

    `waves` (6 x m x 2), `phases` (6 x m) are those of the walls at -x, +x, -y, +y, -z, +z. The rays of a row are
    followed until another wall begins, and that part is painted at once.
    """
    height, width = rays.shape[:2]
    painted, depth, wall = np.zeros((height, width)), np.zeros((height, width)), np.zeros(width, np.int64)
    along, across, ray, there = np.zeros(width), np.zeros(width), np.ones(3), np.zeros(3)
    for row in range(height):
        for column in range(width):
            ray[0], ray[1] = rays[row, column, 0], rays[row, column, 1]
            nearest = np.inf
            for axis in range(3):
                T = T_room_camera[axis]
                there[axis] = T[0] * ray[0] + T[1] * ray[1] + T[2] * ray[2]
                if there[axis] != 0.0:
                    is_beyond = there[axis] > 0.0
                    reach = ((half_size[axis] if is_beyond else -half_size[axis]) - T[3]) / there[axis]
                    if reach < nearest:
                        nearest, wall[column] = reach, 2 * axis + is_beyond
            depth[row, column] = nearest
            first, second = (1 if wall[column] < 2 else 0), (1 if wall[column] >= 4 else 2)
            along[column] = T_room_camera[first, 3] + nearest * there[first]
            across[column] = T_room_camera[second, 3] + nearest * there[second]
        begin = 0
        for column in range(1, width + 1):
            if column == width or wall[column] != wall[begin]:
                part, number = slice(begin, column), wall[begin]
                _add_waves(along[part], across[part], waves[number], phases[number], painted[row, part])
                begin = column
    return painted, depth


@dataclass(frozen=True)
class PaintedRoom:
    """Walls at +-`half_size` (m); each is painted with waves of 5 to 60 cm, so that images are smooth functions."""

    seed: int = 0
    half_size: tuple[float, float, float] = (1.6, 1.2, 2.0)
    contrast: float = 2.5

    def render(self, camera: Camera, T_room_camera: Array) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
        """Return grey image and depth (mm) of a camera in the room."""
        return self._kept(camera, [T_room_camera])

    def _kept(self, camera: Camera, T_room_camera: list[Array]) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
        key = f"{astuple(self)} {astuple(camera)} {np.array(T_room_camera).tobytes().hex()}"
        images = drawn.kept(
            key, lambda: dict(zip(("grey", "depth_mm"), self._draw(camera, T_room_camera), strict=True))
        )
        return images["grey"], images["depth_mm"]

    def _draw(self, camera: Camera, T_room_camera: list[Array]) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
        """Return grey image and depth (mm) whose rows are seen, band by band, from poses that follow one another."""
        bands = np.array_split(Lens.of(camera).rays.astype(np.float64), len(T_room_camera))
        size, walls = np.array(self.half_size), self._waves()
        looks = [_look(rays, T, size, *walls) for rays, T in zip(bands, T_room_camera, strict=True)]
        painted, depth = (np.concatenate(images) for images in zip(*looks, strict=True))
        grey = np.rint(127.5 + 110.0 * np.tanh(self.contrast * 3.0 / _WAVES * painted))
        return grey.astype(np.uint8), np.rint(1000.0 * depth).astype(np.uint16)

    def _waves(self) -> tuple[Array, Array]:
        """Return the waves of all walls (6 x 24 x 2, turns a metre) and their phases (6 x 24, turns)."""
        waves, phases = np.empty((6, _WAVES, 2)), np.empty((6, _WAVES))
        for number in range(6):
            rng = np.random.default_rng([self.seed, number])
            direction, length = rng.uniform(0, 2 * np.pi, _WAVES), np.geomspace(0.05, 0.6, _WAVES)
            waves[number] = np.column_stack([np.cos(direction) / length, np.sin(direction) / length])
            phases[number] = rng.uniform(0, 2 * np.pi, _WAVES) / (2 * np.pi)
        return waves, phases

    def frame(self, camera: Camera, number: int, T_room_camera: Array) -> RgbdFrame:
        """Return the `number`-th frame of a 30 Hz stream, colour and depth taken at once."""
        grey, depth_mm = self.render(camera, T_room_camera)
        stamp = Stamp(START + number * PERIOD)
        return RgbdFrame(number, stamp, grey, stamp, depth_mm)

    def rolled_frame(
        self, camera: Camera, number: int, T_room_camera: Callable[[float], Array], readout_s: float
    ) -> RgbdFrame:
        """Return the `number`-th frame of a camera whose rows are read within `readout_s`, colour and depth at once.

        `T_room_camera(t)` is the pose t seconds after the start; the middle row is read at the frame's time.
        """
        poses = []
        for rows in np.array_split(np.arange(camera.height), _BANDS):
            late_s = ((rows[0] + rows[-1] + 1) / 2.0 / camera.height - 0.5) * readout_s
            poses.append(T_room_camera(number * PERIOD * 1e-9 + late_s))
        grey, depth_mm = self._kept(camera, poses)
        stamp = Stamp(START + number * PERIOD + round(readout_s / 2.0 * 1e9))
        return RgbdFrame(number, stamp, grey, stamp, depth_mm)


def known_readout(readout_s: float) -> OdometrySettings:
    """Return what the odometry expects where it is told how `PaintedRoom.rolled_frame` takes images, precisely."""
    return OdometrySettings(
        readout_prior_s=readout_s,
        readout_prior_sigma_s=1e-5,
        depth_lag_prior_s=-readout_s / 2.0,
        depth_lag_prior_sigma_s=1e-5,
        depth_readout_prior_s=readout_s,
        depth_readout_prior_sigma_s=1e-5,
    )


def stroll(t: float) -> Array:
    """Return T_room_camera after `t` seconds of a calm walk to and fro: .2 m/s and 15 deg/s at most."""
    sway = np.array([0.25 * np.sin(0.8 * t), 0.1 * np.sin(1.1 * t), 0.3 * np.sin(0.5 * t)])
    turn = np.array([0.1 * np.sin(0.9 * t), 0.3 * np.sin(0.7 * t), 0.05 * np.sin(1.3 * t)])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = se3.so3_exp(turn), sway
    return T


def tilted(frame: RgbdFrame, angles: Array) -> RgbdFrame:
    """Return a frame of the SMALL camera as it is where depth has a tilt by `angles` (2, rad; see `depth_tilt`)."""
    more = 1.0 + Lens.of(SMALL).rays.astype(np.float64) @ angles
    return replace(frame, depth_mm=np.rint(frame.depth_mm * more).astype(np.uint16))


def anchor_before_camera(stamp: Stamp) -> Array:
    """Return T_camera_anchor of bodies that the camera carries along (see `Painter`)."""
    return np.eye(4)
