"""A painted box seen from inside: exact images and depth of it from any pose, for tests that need no simulator."""

import math
from collections.abc import Callable
from dataclasses import astuple, dataclass, replace

import drawn
import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera, RgbdFrame, Stamp
from odom.frontend.camera.lens import Lens
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled

SMALL = Camera(320, 240, 262.5, 262.5, 159.5, 119.5)
START = Stamp(1_700_000_000_000_000_000)
PERIOD = 33_333_333
_BANDS = 80
"""Into so many bands of rows a rolling shutter's image is cut, each drawn at once. Of 3 rows, within which a turn of
3 rad/s moves what is seen by .1 px to both sides; edges of bands of 10 rows are off by .8 px, which tears patches."""
_SINE = np.array([(-1) ** k * np.pi ** (2 * k + 1) / math.factorial(2 * k + 1) for k in range(12)])
"""The Taylor series of sin(pi x), of the powers 1, 3, ... 23 of x: to 1e-16 where |x| is at most .5."""


@compiled
def _mean_of_waves(x: Array, y: Array, waves: Array, phases: Array) -> Array:
    """Return at points (x, y: n each, m) the mean of m plane waves (m x 2, turns a metre; phases m, turns).

    `np.cos` takes 20 ns, and a test run needs four thousand million; here a vector's worth is found at a time:
    cos(2 pi t) = 1 - 2 sin(pi t)^2, of t less its whole turns.
    """
    out = np.zeros(len(x))
    for k in range(len(waves)):
        for i in range(len(x)):
            t = waves[k, 0] * x[i] + waves[k, 1] * y[i] + phases[k]
            t -= np.rint(t)
            square, sine = t * t, 0.0
            for n in range(11, -1, -1):
                sine = sine * square + _SINE[n]
            sine *= t
            out[i] += 1.0 - 2.0 * sine * sine
    return out / len(waves)


@dataclass(frozen=True)
class PaintedRoom:
    """Walls at +-`half_size` (m); each is painted with waves of 5 to 60 cm, so that images are smooth functions."""

    seed: int = 0
    half_size: tuple[float, float, float] = (1.6, 1.2, 2.0)
    contrast: float = 2.5

    def render(self, camera: Camera, T_room_camera: Array) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
        """Return grey image and depth (mm) of a camera in the room."""
        key = f"{astuple(self)} {astuple(camera)} {T_room_camera.tobytes().hex()}"
        images = drawn.kept(
            key, lambda: dict(zip(("grey", "depth_mm"), self._draw(camera, T_room_camera), strict=True))
        )
        return images["grey"], images["depth_mm"]

    def _draw(self, camera: Camera, T_room_camera: Array) -> tuple[NDArray[np.uint8], NDArray[np.uint16]]:
        rays = Lens.of(camera).rays.reshape(-1, 2).astype(np.float64)
        directions = np.column_stack([rays, np.ones(len(rays))]) @ T_room_camera[:3, :3].T
        origin, size = T_room_camera[:3, 3], np.array(self.half_size)
        with np.errstate(divide="ignore"):
            reach = (np.sign(directions) * size - origin) / directions
        wall = reach.argmin(axis=1)
        depth = reach[np.arange(len(rays)), wall]
        points = origin + depth[:, None] * directions
        side = 2 * wall + (directions[np.arange(len(rays)), wall] > 0)
        shape = (camera.height, camera.width)
        grey = np.rint(127.5 + 110.0 * np.tanh(self.contrast * self._paint(points, side, wall)))
        return grey.astype(np.uint8).reshape(shape), np.rint(1000.0 * depth).astype(np.uint16).reshape(shape)

    def _paint(self, points: Array, side: NDArray[np.int64], wall: NDArray[np.int64]) -> Array:
        out = np.zeros(len(points))
        for number in np.unique(side):
            rng = np.random.default_rng([self.seed, int(number)])
            here = side == number
            across = np.delete(points[here], int(wall[here][0]), axis=1)
            direction, length = rng.uniform(0, 2 * np.pi, 24), np.geomspace(0.05, 0.6, 24)
            waves = np.column_stack([np.cos(direction) / length, np.sin(direction) / length])
            phases = rng.uniform(0, 2 * np.pi, 24) / (2 * np.pi)
            out[here] = _mean_of_waves(*np.ascontiguousarray(across.T), waves, phases)
        return 3.0 * out

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
        bands = []
        for rows in np.array_split(np.arange(camera.height), _BANDS):
            band = replace(camera, height=len(rows), cy=camera.cy - rows[0])
            late_s = ((rows[0] + rows[-1] + 1) / 2.0 / camera.height - 0.5) * readout_s
            bands.append(self.render(band, T_room_camera(number * PERIOD * 1e-9 + late_s)))
        grey, depth_mm = (np.concatenate(images) for images in zip(*bands, strict=True))
        stamp = Stamp(START + number * PERIOD + round(readout_s / 2.0 * 1e9))
        return RgbdFrame(number, stamp, grey, stamp, depth_mm)


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
