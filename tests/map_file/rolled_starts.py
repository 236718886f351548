"""A camera that wakes anywhere in the second half of a recording, rolled, in the map of the first half.

    python tests/map_file/rolled_starts.py FOLDER --starts 100

Recorded images are turned, and so is their shutter: as it was, it would run over the turned image in another direction
than the rows of any camera do. A pixel shows what its row would have seen at its time, by the depth there and the
camera's motion. Poses are compared with those of the whole recording, adjusted at its end.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

from odom import read_recording
from odom.backend import Odometry, State
from odom.frame import Camera, RgbdFrame
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.map_file.map_file import MapFile

CELL = 8
"""Pixels between the points at which it is worked out where a turned image comes from."""
LOOKS = 31
"""Frames from waking on: a second."""


class TurnedCamera:
    """A camera rolled by `degrees`, which sees what the frames of an upright one show; of the same timing."""

    def __init__(self, camera: Camera, timing: ShutterTiming, degrees: float) -> None:
        self.size = camera.height, camera.width
        self._K, self._distortion = camera.matrix, np.array(camera.distortion or (0.0,) * 5)
        self._timing = timing
        self.T_old_new = se3.exp(np.array([0.0, 0.0, 0.0, 0.0, 0.0, np.deg2rad(degrees)]))
        at = [np.arange(0.0, n + CELL, CELL) for n in (camera.width, camera.height)]
        uv = np.stack(np.meshgrid(*at), axis=-1)
        self._row = self._rows(uv[..., 1]).ravel()
        rays = cv2.undistortPoints(uv.reshape(-1, 1, 2), self._K, self._distortion)[:, 0]
        self._shape, self._rays = uv.shape, rays @ self.T_old_new[:2, :2].T
        self._fine = [a.astype(np.float32) / CELL for a in np.meshgrid(*(np.arange(n) for n in self.size[::-1]))]

    def _rows(self, v: Array) -> Array:
        """When rows are read, as a share of the readout from the middle on."""
        return np.clip(v / (self.size[0] - 1), 0.0, 1.0) - 0.5

    def frame(self, frame: RgbdFrame, twist: Array) -> RgbdFrame:
        """What it sees where the upright camera, which moves with `twist` (SI, its own frame), saw `frame`."""
        upright = self._pixels(self._rays)
        j, i = (np.clip(upright[:, k].astype(int), 0, self.size[1 - k] - 1) for k in (0, 1))
        depth_mm = frame.depth_mm[i, j].astype(float)
        known = depth_mm > 0
        depth_mm[~known] = np.median(depth_mm[known]) if known.any() else 1000.0
        flow = self._flow(self._rays, 1e3 / depth_mm, twist)
        color, _ = self._source(upright, flow, self._timing.readout_s)
        depth, late_s = self._source(upright, flow, self._timing.depth_readout_s)
        seen = cv2.remap(frame.depth_mm, *depth, cv2.INTER_NEAREST)
        nearer = flow[:, 2].reshape(self._shape[:2]) * late_s
        change = cv2.remap(nearer.astype(np.float32), *self._fine, cv2.INTER_LINEAR)
        moved = np.divide(1e3, 1e3 / np.maximum(seen, 1) + change)
        moved = np.where(seen > 0, np.clip(np.round(moved), 0, 65535), 0).astype(np.uint16)
        return replace(frame, color=cv2.remap(frame.color, *color, cv2.INTER_LINEAR), depth_mm=moved)

    def _source(self, upright: Array, flow: Array, readout_s: float) -> tuple[list[Array], Array]:
        """Where in the recorded image each pixel comes from, and how much later it is seen there (by cells)."""
        pixels = upright
        for _ in range(2):
            late_s = (self._row - self._rows(pixels[:, 1])) * readout_s
            pixels = self._pixels(self._rays - flow[:, :2] * late_s[:, None])
        coarse = pixels.reshape(self._shape).astype(np.float32)
        fine = [cv2.remap(coarse[..., k], *self._fine, cv2.INTER_LINEAR) for k in (0, 1)]
        return fine, late_s.reshape(self._shape[:2])

    def _pixels(self, rays: Array) -> Array:
        out, _ = cv2.projectPoints(
            np.column_stack([rays, np.ones(len(rays))]), np.zeros(3), np.zeros(3), self._K, self._distortion
        )
        return np.where(np.abs(rays).max(axis=1, keepdims=True) > 1.2, -1e3, out[:, 0])

    @staticmethod
    def _flow(rays: Array, w: Array, twist: Array) -> Array:
        """Rates (n x 3, 1/s) of (x/z, y/z, 1/z) of resting points (see `point_flow`)."""
        (x, y), (tx, ty, tz, rx, ry, rz) = rays.T, twist
        turn = x * ry - y * rx
        rates = w * (x * tz - tx) - ry - x * turn + y * rz, w * (y * tz - ty) + rx - y * turn - x * rz
        return np.column_stack([*rates, w * (w * tz - turn)])


@dataclass(frozen=True)
class Looked:
    """One frame after waking: how many `frames` before it, and how far off it is; None where it has no pose."""

    start: int
    degrees: float
    frames: int
    state: State
    metres: float | None = None
    turned_deg: float | None = None


def looked(folder: Path, map_: Path, starts: int, seed: int = 0) -> Iterator[Looked]:
    """Make the map of the first half at `map_`, wake in the second half, and yield every look."""
    recording = read_recording(folder)
    frames, camera = list(recording), recording.camera
    half = len(frames) // 2
    whole = Odometry(camera)
    for frame in frames:
        whole.process(frame)
    T_world_camera = {p.stamp: p.T_map_camera for p in whole.finish() if p.T_map_camera is not None}
    opened = MapFile(map_, is_written=True)
    made = Odometry(camera, None, opened.begin(camera))
    for frame in frames[:half]:
        made.process(frame)
    made.finish()
    opened.put(made.take_map_changes())
    opened.close()
    opened = MapFile(map_, is_written=False)
    at = [T_world_camera[k.stamp] @ se3.inverse(k.T_middle_stamp) @ k.T_camera_map for k in opened.keyframes()[1:]]
    T_world_map = at[0]
    for _ in range(5):
        T_world_map = T_world_map @ se3.exp(np.mean([se3.log(se3.inverse(T_world_map) @ T) for T in at], axis=0))
    rng = np.random.default_rng(seed)
    for _ in range(starts):
        start, degrees = int(rng.integers(half, len(frames) - LOOKS - 1)), 30.0 * float(rng.integers(0, 7))
        turned, odometry = TurnedCamera(camera, made.timing, degrees), Odometry(camera, None, opened.begin(camera))
        for k in range(LOOKS):
            before, frame, after = frames[start + k - 1 : start + k + 2]
            step = se3.inverse(T_world_camera[before.stamp]) @ T_world_camera[after.stamp]
            estimate = odometry.process(turned.frame(frame, se3.log(step) / ((after.stamp - before.stamp) * 1e-9)))
            if estimate.T_odom_camera is None:
                yield Looked(start, degrees, k, estimate.state)
                continue
            T = T_world_map @ estimate.T_map_odom @ estimate.T_odom_camera @ se3.inverse(turned.T_old_new)
            xi = se3.log(se3.inverse(T_world_camera[frame.stamp]) @ T)
            off = float(np.linalg.norm(xi[:3])), float(np.rad2deg(np.linalg.norm(xi[3:])))
            yield Looked(start, degrees, k, estimate.state, *off)
        odometry.finish()
    opened.close()


@dataclass(frozen=True)
class Found:
    """What many looks came to."""

    recognised: float
    at_once: float
    near: float
    """Share of the poses within 3 cm and 2 deg."""
    wrong: int
    """Poses called TRACKING that are more than 20 cm off."""
    worst_m: float
    worst_deg: float

    @classmethod
    def of(cls, looks: list[Looked]) -> "Found":
        """Add up looks."""
        posed = [(one, one.metres, one.turned_deg) for one in looks if one.metres is not None]
        woken = sum(one.frames == 0 for one in looks)
        near = [m <= 0.03 and deg is not None and deg <= 2.0 for _, m, deg in posed]
        return cls(
            len({(one.start, one.degrees) for one, *_ in posed}) / len({(o.start, o.degrees) for o in looks}),
            sum(one.frames == 0 for one, *_ in posed) / woken,
            float(np.mean(near)),
            sum(one.state is State.TRACKING and m > 0.2 for one, m, _ in posed),
            max(m for _, m, _ in posed),
            max(deg for _, _, deg in posed if deg is not None),
        )


def main() -> None:
    """Print what is found, and how far off it is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    with TemporaryDirectory() as folder:
        looks = list(looked(given.folder, Path(folder, "half.map"), given.starts, given.seed))
    print(Found.of(looks))
    for degrees in sorted({one.degrees for one in looks}):
        print(f"{degrees:.0f} deg", Found.of([one for one in looks if one.degrees == degrees]))


if __name__ == "__main__":
    main()
