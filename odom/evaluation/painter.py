"""Bodies painted into recorded RGB-D frames, with a depth of their own.

A recording of a scene at rest, with its truth, becomes one of a scene with people: how far an odometry is misled by
them can then be measured. A body is an upright elliptic cylinder with a printed front; it hides what is behind it and
is hidden by what stands before it, and it is seen by colour and depth each at its own stamp.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.errors import InputError
from odom.evaluation.passers_by import PasserBy
from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera, RgbdFrame, Stamp
from odom.frontend.camera.lens import Lens
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask
from odom.geometry.compiled import compiled
from odom.registration import KinectV1

_ANCHOR_S = 1.5
"""Deviation (seconds) of the Gaussian that smooths the camera's path: bodies stay where the camera roughly looks."""
_KEEP_AWAY_M = 0.3
"""Nothing nearer to the camera than this is painted: a depth camera would not see it."""
_GLOBAL_SHUTTER = ShutterTiming()
_BANDS = 12
"""Bands of rows that a rolling shutter reads one after another, each at one time: .1 px a band in a quick turn."""

Seen = tuple[Array, NDArray[np.float32], NDArray[np.float32]]
"""What each pixel sees of a body: its depth (H x W, m; infinite where it is not), and x and y in its print (texels)."""


@dataclass(frozen=True, eq=False)
class Painter:
    """Paints `bodies` into frames of `camera`; `T_camera_anchor` gives the frame they walk in, at a stamp (ns).

    Equal frames are painted equally, in whatever order they come. `begin` is the stamp at which the walk begins. The
    rows of an image show them one after another, as the `timing` says.
    """

    camera: Camera
    bodies: tuple[PasserBy, ...]
    begin: Stamp
    T_camera_anchor: Callable[[Stamp], Array]
    lens: Lens
    seed: int = 1
    timing: ShutterTiming = _GLOBAL_SHUTTER

    def paint(self, frame: RgbdFrame) -> tuple[RgbdFrame, Mask]:
        """Return the frame with the bodies in it, and which pixels of its colour image (H x W) show one."""
        color, brightness = frame.color.copy(), float(frame.color.mean()) / 120.0
        scene_m = np.asarray(frame.depth_mm * 1e-3, dtype=np.float64)
        scene_m[frame.depth_mm == 0] = np.inf
        nearest, mask = scene_m.copy(), np.zeros(scene_m.shape, bool)
        for body, (z, x, y) in zip(self.bodies, self._seen_by_color(frame), strict=True):
            hides = z < nearest
            if not hides.any():
                continue
            nearest[hides] = z[hides]
            mask |= hides
            printed = cv2.remap(body.front, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[hides]
            painted = np.clip(printed * min(brightness, 1.3), 0, 255).astype(np.uint8)
            color[hides] = painted if color.ndim == 3 else cv2.cvtColor(painted[None], cv2.COLOR_RGB2GRAY)[0]
        measured, depth_mm = scene_m.copy(), frame.depth_mm.copy()
        for z, _, _ in self._seen_by_depth(frame):
            np.minimum(measured, z, out=measured)
        is_body = measured < scene_m
        depth_mm[is_body] = self._noisy_mm(measured[is_body], frame.depth_stamp)
        return replace(frame, color=color, depth_mm=depth_mm), mask

    def _seen_by_color(self, frame: RgbdFrame) -> list[Seen]:
        return self._seen(Stamp(frame.stamp - round(1e9 * self.timing.since_middle_s)), self.timing.readout_s)

    def _seen_by_depth(self, frame: RgbdFrame) -> list[Seen]:
        return self._seen(Stamp(frame.depth_stamp + round(1e9 * self.timing.depth_lag_s)), self.timing.depth_readout_s)

    def _seen(self, middle: Stamp, readout_s: float) -> list[Seen]:
        """Return what each pixel sees of each body in an image whose `middle` row was read at that stamp."""
        edges = np.linspace(0, len(self.lens.rays), 1 + (_BANDS if readout_s else 1)).astype(int)
        bands = []
        for above, below in itertools.pairwise(edges.tolist()):
            late = 0.5 * (above + below) / len(self.lens.rays) - 0.5
            stamp = Stamp(middle + round(1e9 * readout_s * late))
            T, t = self.T_camera_anchor(stamp), (stamp - self.begin) * 1e-9
            rays = self.lens.rays[above:below]
            bands.append([seen(body, T @ body.T_anchor_body(t), rays) for body in self.bodies])
        return [_stacked(of_body) for of_body in zip(*bands, strict=True)]

    def _noisy_mm(self, depth_m: Array, stamp: Stamp) -> NDArray[np.uint16]:
        rng = np.random.default_rng([self.seed, stamp])
        noisy = depth_m + KinectV1().sigmas(depth_m)[1] * rng.standard_normal(len(depth_m))
        return np.clip(np.rint(1000.0 * noisy), 0, 65535).astype(np.uint16)


def _stacked(bands: Sequence[Seen]) -> Seen:
    """Return what an image sees, by what its bands of rows see."""
    depth, x, y = (np.concatenate(each) for each in zip(*bands, strict=True))
    return depth, x, y


def seen(body: PasserBy, T_camera_body: Array, rays: NDArray[np.float32]) -> Seen:
    """Return what the pixels of `rays` (H x W x 2) see of a body (see Seen)."""
    half_m = 0.5 * np.array([body.width_m, body.height_m, body.thickness_m])
    rows, columns = body.front.shape[:2]
    texels_m = np.array([columns / body.width_m, rows / body.height_m])
    return _cast(rays, se3.inverse(T_camera_body), half_m, texels_m)


@compiled
def _cast(rays: NDArray[np.float32], T_body_camera: Array, half_m: Array, texels_m: Array) -> Seen:
    """Meet each pixel's ray with an elliptic cylinder of half axes `half_m` (x, y, z); `texels_m` are a metre's."""
    height, width = rays.shape[:2]
    depth, x_texel = np.full((height, width), np.inf), np.zeros((height, width), np.float32)
    y_texel = np.zeros((height, width), np.float32)
    R = T_body_camera
    ox, oz = R[0, 3] / half_m[0], R[2, 3] / half_m[2]
    for i in range(height):
        for j in range(width):
            u, v = np.float64(rays[i, j, 0]), np.float64(rays[i, j, 1])
            dx = (u * R[0, 0] + v * R[0, 1] + R[0, 2]) / half_m[0]
            dz = (u * R[2, 0] + v * R[2, 1] + R[2, 2]) / half_m[2]
            dd, do = dx * dx + dz * dz, dx * ox + dz * oz
            root = do * do - dd * (ox * ox + oz * oz - 1.0)
            if root <= 0.0:
                continue
            z = (-do - np.sqrt(root)) / dd
            y = R[1, 3] + z * (u * R[1, 0] + v * R[1, 1] + R[1, 2])
            if z > _KEEP_AWAY_M and abs(y) < half_m[1]:
                depth[i, j] = z
                x_texel[i, j] = ((ox + z * dx) * half_m[0] + half_m[0]) * texels_m[0] - 0.5
                y_texel[i, j] = (y + half_m[1]) * texels_m[1] - 0.5
    return depth, x_texel, y_texel


def anchor_in_world(truth: Trajectory) -> Callable[[Stamp], Array]:
    """Return T_camera_anchor by the stamp: bodies in the world follow the camera's path without its quick motions.

    `truth` is that of the camera; before its first pose and after its last one the camera is taken to stand still.
    Raises InputError when there is no truth.
    """
    if not len(truth):
        raise InputError("the truth is empty: bodies can walk before the camera only, not in the world")
    from scipy.ndimage import gaussian_filter1d
    from scipy.spatial.transform import Rotation

    grid = np.arange(truth.stamps[0], truth.stamps[-1] + 1, 50_000_000)
    whole = truth.at(grid, np.inf)[0]
    smoothed = gaussian_filter1d(whole, _ANCHOR_S / 0.05, axis=0, mode="nearest")
    U, _, Vt = np.linalg.svd(smoothed[:, :3, :3])
    smoothed[:, :3, :3] = Rotation.from_matrix(U @ Vt).as_matrix()
    anchor = Trajectory(grid, smoothed)

    def T_camera_anchor(stamp: Stamp) -> Array:
        return np.asarray(se3.inverse(_pose_near(truth, stamp)) @ _pose_near(anchor, stamp))

    return T_camera_anchor


def anchor_at_rest(path: Trajectory) -> Callable[[Stamp], Array]:
    """Return T_camera_anchor by the stamp: bodies walk where the camera of this `path` looked halfway through.

    Before its first pose and after its last one the camera is taken to stand still. Raises InputError without a pose.
    """
    if not len(path):
        raise InputError("the path is empty: bodies can rest in the world only where the camera's poses are known")
    T_world_anchor = path.T_world_body[len(path) // 2]

    def T_camera_anchor(stamp: Stamp) -> Array:
        return np.asarray(se3.inverse(_pose_near(path, stamp)) @ T_world_anchor)

    return T_camera_anchor


def _pose_near(path: Trajectory, stamp: Stamp) -> Array:
    """Return the pose (4 x 4) at a stamp, before the path's first pose that one, and after its last one that."""
    return np.asarray(path.at(np.clip([stamp], path.stamps[0], path.stamps[-1]), np.inf)[0][0])
