"""Automatic exposure and white balance: gain follows the image's brightness with delay and in part."""

from functools import lru_cache

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.se3 import inverse
from sensors.arena.array_types import Float32
from sensors.arena.building import Building
from sensors.arena.camera_path import LAP_S, Infinity, Walk
from sensors.arena.color_chip import unpack
from sensors.arena.renderer import JITTER, Moments, Renderer

STEP_S = 0.2
"""Time between two gains, seconds; between them it is interpolated. Shorter takes longer to prepare."""
LAG_S = 0.7
"""Time constant of the control, seconds: longer, the picture stays too bright or dark longer after a turn."""
AIM = 112.0
"""Mean display value that it seeks: the middle of the range, as cameras do."""
STRENGTH = 0.6
"""How far it goes towards its aim, as an exponent: 1 would make every picture equally bright."""
LIMITS = (0.7, 1.5)
"""Least and greatest gain: wider, dark corners are shown as bright as windows."""
SHAPE = (24, 32)
"""Rows and columns of the picture that brightness is measured on."""


@lru_cache(maxsize=4)
def _gains(scene: Renderer | Building, walk: Walk, seconds: float) -> Array:
    """Return n x 3 gains, every STEP_S of the walk (of one lap, if it repeats)."""
    K = np.array([26.0, 26.0, 15.5, 11.5])
    periodic = isinstance(walk, Infinity)
    length = LAP_S if periodic else seconds
    means = []
    for t in np.arange(0.0, length, STEP_S):
        T = inverse(walk.T_world_camera(float(t)))
        light, _ = scene.color(np.stack([T] * len(JITTER)), K, SHAPE, Moments(np.full(len(JITTER), t)))
        means.append(unpack(light).reshape(-1, 3).mean(axis=0))
    mean = np.array(means)
    level = np.clip((AIM / mean.mean(axis=1)) ** STRENGTH, *LIMITS)
    tint = (mean.mean(axis=1, keepdims=True) / mean) ** 0.25
    wanted = level[:, None] * tint
    gain, out = wanted[0], np.empty_like(wanted)
    for _lap in range(2 if periodic else 1):
        for k in range(len(wanted)):
            gain = gain + (wanted[k] - gain) * (1 - np.exp(-STEP_S / LAG_S))
            out[k] = gain
    return np.concatenate([out, out[:1] if periodic else out[-1:]])


def exposure_gain(scene: Renderer | Building, walk: Walk, seconds: float, t: float, seed: int) -> Float32:
    """Return the gain of red, green and blue display values at `t` seconds of a walk that lasts `seconds`."""
    gains = _gains(scene, walk, seconds)
    at = np.clip((t % LAP_S if isinstance(walk, Infinity) else t) / STEP_S, 0, len(gains) - 1.001)
    k = int(at)
    flicker = 1 + 0.004 * float(np.sin(2 * np.pi * 0.9 * t + seed))
    return np.asarray(((1 - at + k) * gains[k] + (at - k) * gains[k + 1]) * flicker, np.float32)
