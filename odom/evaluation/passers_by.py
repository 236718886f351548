"""Bodies that walk to and fro, painted into recorded RGB-D frames with a depth of their own.

A recording of a scene at rest, with its truth, becomes one of a scene with people: how far an odometry is misled by
them can then be measured. A body is an upright elliptic cylinder with a printed front; it hides what is behind it and
is hidden by what stands before it, and it is seen by colour and depth each at its own stamp.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.errors import InputError
from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera, RgbdFrame, Stamp
from odom.frontend.camera.lens import Lens
from odom.geometry import se3
from odom.geometry.arrays import Array, Image, Mask
from odom.geometry.compiled import compiled
from odom.registration import KinectV1

_TEXELS_A_PIXEL = 1.3
"""Texels of a print for a pixel at the body's usual distance: fewer blur it, many more glitter."""
_ANCHOR_S = 1.5
"""Deviation (seconds) of the Gaussian that smooths the camera's path: bodies stay where the camera roughly looks."""
_KEEP_AWAY_M = 0.3
"""Nothing nearer to the camera than this is painted: a depth camera would not see it."""


Seen = tuple[Array, NDArray[np.float32], NDArray[np.float32]]
"""What each pixel sees of a body: its depth (H x W, m; infinite where it is not), and x and y in its print (texels)."""


@dataclass(frozen=True, eq=False)
class PasserBy:
    """One body; its frame is x right, y down, z away from a camera that looks straight at it, its origin its middle.

    It walks across the view, `reach_m` to both sides, at `speed_m_s`, from where `phase` (radians) says.
    """

    front: Image
    width_m: float
    height_m: float
    thickness_m: float
    distance_m: float
    reach_m: float
    speed_m_s: float
    phase: float

    def T_anchor_body(self, t: float) -> Array:
        """Return the body's pose `t` seconds after the beginning, in the frame of a camera that looks at its path."""
        turn = 0.5 * np.pi * self.speed_m_s / self.reach_m * t + self.phase
        across = self.reach_m * 2.0 / np.pi * np.arcsin(0.98 * np.sin(turn))
        nearer = 0.06 * self.distance_m * np.sin(0.31 * turn + 2.0 * self.phase)
        bob = 0.012 * np.sin(2.0 * np.pi * 1.8 * t + self.phase)
        T = np.eye(4)
        T[:3, :3] = se3.so3_exp(np.array([0.0, 0.35 * np.cos(turn), 0.03 * np.sin(2.0 * np.pi * 0.9 * t)]))
        T[:3, 3] = across, bob, self.distance_m + nearer
        return T


def passers_by(
    camera: Camera, distance_m: float, *, count: int = 1, share: float = 0.33, speed_m_s: float = 0.6, seed: int = 1
) -> tuple[PasserBy, ...]:
    """Return `count` bodies, the widest `share` of the image wide at about `distance_m`, each with a print of its own.

    With several of them the others have .5 to 1 of that width. Speeds are .7 to 1.3 of `speed_m_s`. Raises InputError
    for a share, speed or distance that is not positive.
    """
    if min(share, speed_m_s, distance_m) <= 0 or count < 0:
        raise InputError(f"{count} bodies {share} wide at {distance_m} m and {speed_m_s} m/s: give positive numbers")
    bodies = []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        distance = distance_m * rng.uniform(0.85, 1.1)
        view_m = camera.width / camera.fx * distance
        width = share * view_m * (rng.uniform(0.5, 1.0) if number else 1.0)
        height = camera.height / camera.fy * distance * rng.uniform(0.8, 1.4)
        texel_m = distance / camera.fx / _TEXELS_A_PIXEL
        size = max(2, round(height / texel_m)), max(2, round(width / texel_m))
        bodies.append(
            PasserBy(
                front=clothes(size, 0.01 / texel_m, rng),
                width_m=width,
                height_m=height,
                thickness_m=float(rng.uniform(0.02, 0.25)),
                distance_m=distance,
                reach_m=view_m * float(rng.uniform(0.3, 0.55)),
                speed_m_s=speed_m_s * float(rng.uniform(0.7, 1.3)),
                phase=float(rng.uniform(0, 2 * np.pi)),
            )
        )
    return tuple(bodies)


def clothes(size: tuple[int, int], texels_a_cm: float, rng: np.random.Generator) -> Image:
    """Return a print of `size` (rows, columns): patches and letters' size of detail, the lower part plainer."""
    base = rng.uniform(60, 190, 3)
    out = np.zeros((*size, 3), np.float32) + base.astype(np.float32)
    for cell_cm, contrast in ((12.0, 26.0), (4.0, 34.0), (1.2, 30.0)):
        cells = [max(2, int(n / (cell_cm * texels_a_cm)) + 1) for n in size]
        noise = contrast * (rng.normal(0, 0.9, (*cells, 1)) + rng.normal(0, 0.4, (*cells, 3))).astype(np.float32)
        how = cv2.INTER_NEAREST if cell_cm == 4.0 else cv2.INTER_CUBIC
        out += cv2.resize(noise, size[::-1], interpolation=how)
    waist = int(size[0] * rng.uniform(0.45, 0.9))
    plain = rng.uniform(40, 120, 3) + 0.12 * (out[waist:] - out[waist:].mean(axis=(0, 1)))
    out[waist:] = plain
    return np.clip(out, 0, 255).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class Painter:
    """Paints `bodies` into frames of `camera`; `T_camera_anchor` gives the frame they walk in, at a stamp (ns).

    Equal frames are painted equally, in whatever order they come. `begin` is the stamp at which the walk begins.
    """

    camera: Camera
    bodies: tuple[PasserBy, ...]
    begin: Stamp
    T_camera_anchor: Callable[[Stamp], Array]
    lens: Lens
    seed: int = 1

    def paint(self, frame: RgbdFrame) -> tuple[RgbdFrame, Mask]:
        """Return the frame with the bodies in it, and which pixels of its colour image (H x W) show one."""
        color, brightness = frame.color.copy(), float(frame.color.mean()) / 120.0
        scene_m = np.asarray(frame.depth_mm * 1e-3, dtype=np.float64)
        scene_m[frame.depth_mm == 0] = np.inf
        nearest, mask = scene_m.copy(), np.zeros(scene_m.shape, bool)
        for body, (z, x, y) in zip(self.bodies, self._seen(frame.stamp), strict=True):
            hides = z < nearest
            if not hides.any():
                continue
            nearest[hides] = z[hides]
            mask |= hides
            printed = cv2.remap(body.front, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[hides]
            painted = np.clip(printed * min(brightness, 1.3), 0, 255).astype(np.uint8)
            color[hides] = painted if color.ndim == 3 else cv2.cvtColor(painted[None], cv2.COLOR_RGB2GRAY)[0]
        measured, depth_mm = scene_m.copy(), frame.depth_mm.copy()
        for z, _, _ in self._seen(frame.depth_stamp):
            np.minimum(measured, z, out=measured)
        is_body = measured < scene_m
        depth_mm[is_body] = self._noisy_mm(measured[is_body], frame.depth_stamp)
        return replace(frame, color=color, depth_mm=depth_mm), mask

    def _seen(self, stamp: Stamp) -> list[Seen]:
        T, t = self.T_camera_anchor(stamp), (stamp - self.begin) * 1e-9
        return [seen(body, T @ body.T_anchor_body(t), self.lens) for body in self.bodies]

    def _noisy_mm(self, depth_m: Array, stamp: Stamp) -> NDArray[np.uint16]:
        rng = np.random.default_rng([self.seed, stamp])
        noisy = depth_m + KinectV1().sigmas(depth_m)[1] * rng.standard_normal(len(depth_m))
        return np.clip(np.rint(1000.0 * noisy), 0, 65535).astype(np.uint16)


def seen(body: PasserBy, T_camera_body: Array, lens: Lens) -> Seen:
    """Return what each pixel sees of a body (see Seen)."""
    half_m = 0.5 * np.array([body.width_m, body.height_m, body.thickness_m])
    rows, columns = body.front.shape[:2]
    texels_m = np.array([columns / body.width_m, rows / body.height_m])
    return _cast(lens.rays, se3.inverse(T_camera_body), half_m, texels_m)


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
        camera, slow = (
            each.at(np.clip([stamp], each.stamps[0], each.stamps[-1]), np.inf)[0][0] for each in (truth, anchor)
        )
        return np.asarray(se3.inverse(camera) @ slow)

    return T_camera_anchor


def anchor_before_camera(stamp: Stamp) -> Array:
    """Return T_camera_anchor of bodies that the camera carries along: for recordings without truth."""
    return np.eye(4)


def nearer_than(frames: Sequence[RgbdFrame]) -> float:
    """Return a distance (m) before most of what some frames show; 1 m where they measure nothing."""
    known = [frame.depth_mm[frame.depth_mm > 0] for frame in frames]
    every = np.concatenate(known) if known else np.zeros(0)
    return max(0.6, 0.85e-3 * float(np.percentile(every, 20))) if len(every) else 1.0
