"""Bodies that walk to and fro before a camera, some of which stand still time and again (see `painter`)."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from odom.errors import InputError
from odom.frame import Camera, RgbdFrame
from odom.geometry import se3
from odom.geometry.arrays import Array, Image

_TEXELS_A_PIXEL = 1.3
"""Texels of a print for a pixel at the body's usual distance: fewer blur it, many more glitter."""


@dataclass(frozen=True, eq=False)
class PasserBy:
    """One body; its frame is x right, y down, z away from a camera that looks straight at it, its origin its middle.

    It walks across the view, `reach_m` to both sides, at `speed_m_s`, from where `phase` (radians) says. During the
    `rests`, each from one time to another (s), it stands still.
    """

    front: Image
    width_m: float
    height_m: float
    thickness_m: float
    distance_m: float
    reach_m: float
    speed_m_s: float
    phase: float
    rests: tuple[tuple[float, float], ...] = ()

    def T_anchor_body(self, t: float) -> Array:
        """Return the body's pose `t` seconds after the beginning, in the frame of a camera that looks at its path."""
        t -= sum(min(max(t - begin, 0.0), end - begin) for begin, end in self.rests)
        turn = 0.5 * np.pi * self.speed_m_s / self.reach_m * t + self.phase
        across = self.reach_m * 2.0 / np.pi * np.arcsin(0.98 * np.sin(turn))
        nearer = 0.06 * self.distance_m * np.sin(0.31 * turn + 2.0 * self.phase)
        bob = 0.012 * np.sin(2.0 * np.pi * 1.8 * t + self.phase)
        T = np.eye(4)
        T[:3, :3] = se3.so3_exp(np.array([0.0, 0.35 * np.cos(turn), 0.03 * np.sin(2.0 * np.pi * 0.9 * t)]))
        T[:3, 3] = across, bob, self.distance_m + nearer
        return T


def passers_by(
    camera: Camera,
    distance_m: float,
    *,
    count: int = 1,
    share: float = 0.33,
    speed_m_s: float = 0.6,
    seed: int = 1,
    rest: bool = False,
) -> tuple[PasserBy, ...]:
    """Return `count` bodies, the widest `share` of the image wide at about `distance_m`, each with a print of its own.

    With several of them the others have .5 to 1 of that width. Speeds are .7 to 1.3 of `speed_m_s`. Those that `rest`
    stand still at first, and time and again. Raises InputError for a share, speed or distance that is not positive.
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
                rests=_rests(np.random.default_rng([seed, number, 1])) if rest else (),
            )
        )
    return tuple(bodies)


def _rests(rng: np.random.Generator) -> tuple[tuple[float, float], ...]:
    """Return rests of 1 to 5 s with walks of .5 to 2.5 s between them, for ten minutes."""
    rests, t = [], 0.0
    while t < 600.0:
        end = t + float(rng.uniform(1.0, 5.0))
        rests.append((t, end))
        t = end + float(rng.uniform(0.5, 2.5))
    return tuple(rests)


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


def nearer_than(frames: Sequence[RgbdFrame]) -> float:
    """Return a distance (m) before most of what some frames show; 1 m where they measure nothing."""
    known = [frame.depth_mm[frame.depth_mm > 0] for frame in frames]
    every = np.concatenate(known) if known else np.zeros(0)
    return max(0.6, 0.85e-3 * float(np.percentile(every, 20))) if len(every) else 1.0
