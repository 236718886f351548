"""Depth as a Kinect v2 measures it: the phase of modulated light that comes back, from all that a pixel receives.

The chain is simulated: each pixel adds up the light of four samples of its footprint (so depth flies between near and
far at edges), of the lens's own stray light and of the light that comes by way of the surroundings (so corners seem
rounder and near things pull far ones), with photon noise against ambient light; the phase of that sum is the depth.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera
from odom.registration.compiled import compiled
from sensors.arena.noise import TILE, Tiles

Array = NDArray[np.float64]

INFRARED = Camera(512, 424, 365.5, 365.5, 255.5, 207.5)
SHAPE = (INFRARED.height, INFRARED.width)
T_COLOR_INFRARED = np.array([[1, 0, 0, -0.052], [0, 1, 0, 0.0], [0, 0, 1, 0.0], [0, 0, 0, 1.0]])
"""The infrared camera sits 52 mm left of the colour camera."""
MODULATION_HZ = 80e6
"""The middle one of the three frequencies; the others only tell its turns apart."""
SPEED_OF_LIGHT = 299_792_458.0
RADIANS_A_METRE = 4 * np.pi * MODULATION_HZ / SPEED_OF_LIGHT
STRAY = 0.006
"""Share of all light that the lens spreads over the image."""
DETOUR = 0.025
"""Share of its neighbourhood's light that a surface receives and sends back, on a detour."""
DETOUR_M = 0.25
"""How much longer that way is."""
AMBIENT = 0.02
PHOTONS = 9e4
"""Electrons at 1 m from a white surface that faces the camera."""
NEAREST_M, FARTHEST_M = 0.5, 4.8
LEAST_AMPLITUDE = 0.011
"""Weaker light gives no depth."""


def _ray_length2() -> NDArray[np.float32]:
    x = (np.arange(INFRARED.width) - INFRARED.cx) / INFRARED.fx
    y = (np.arange(INFRARED.height) - INFRARED.cy) / INFRARED.fy
    return np.asarray(1 + x[None, :] ** 2 + y[:, None] ** 2, np.float32)


RAY_LENGTH2 = _ray_length2()


@compiled
def receive(
    inverse_depth: NDArray[np.float32],
    identity: NDArray[np.int16],
    distance: NDArray[np.float32],
    infrared: NDArray[np.float32],
    ray_length2: NDArray[np.float32],
    real: NDArray[np.float32],
    imaginary: NDArray[np.float32],
) -> None:
    """Add to the two parts of each pixel's phasor what one sample of its footprint sends back (a quarter each)."""
    height, width = inverse_depth.shape
    turn = np.float32(RADIANS_A_METRE)
    for y in range(height):
        for x in range(width):
            i = identity[y, x]
            if i < 0:
                continue
            w = inverse_depth[y, x]
            length2 = ray_length2[y, x]
            length = np.sqrt(length2)
            cosine = distance[i] * w / length
            amplitude = np.float32(0.25) * infrared[i] * cosine * w * w / length2
            phase = turn * length / w
            real[y, x] += amplitude * np.cos(phase)
            imaginary[y, x] += amplitude * np.sin(phase)


@compiled
def decide(
    real: NDArray[np.float32],
    imaginary: NDArray[np.float32],
    grain: NDArray[np.float32],
    at: tuple[int, int, int, int],
    expected: NDArray[np.float32],
    ray_length2: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Turn phasors into depth along the optical axis (m); `expected` (1/m) only settles the whole turns."""
    height, width = real.shape
    mask = TILE - 1
    turn = np.float32(RADIANS_A_METRE)
    full = np.float32(2 * np.pi)
    for y in range(height):
        noise_a, noise_b = grain[(y + at[0]) & mask], grain[(y + at[2]) & mask]
        for x in range(width):
            a, b = real[y, x], imaginary[y, x]
            amplitude = np.sqrt(a * a + b * b)
            sigma = np.sqrt((amplitude + np.float32(AMBIENT)) / np.float32(PHOTONS))
            a += sigma * noise_a[(x + at[1]) & mask]
            b += sigma * noise_b[(x + at[3]) & mask]
            out[y, x] = np.float32(0)
            if amplitude < np.float32(LEAST_AMPLITUDE) or expected[y, x] <= np.float32(0):
                continue
            phase = np.arctan2(b, a)
            length = np.sqrt(ray_length2[y, x])
            turns = np.floor((turn * length / expected[y, x] - phase) / full + np.float32(0.5))
            z = (phase + full * turns) / turn / length
            if np.float32(NEAREST_M) <= z <= np.float32(FARTHEST_M):
                out[y, x] = z


def measured_depth(
    expected: NDArray[np.float32],
    samples: list[tuple[NDArray[np.float32], NDArray[np.int16], Array]],
    infrared: NDArray[np.float32],
    tiles: Tiles,
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """Return the depth image (m, 0 unknown) of the pixels' footprints, each sample as `Renderer.depth` gives it.

    `expected` (inverse depth at the pixels' middles) stands for the other modulation frequencies.
    """
    real, imaginary = np.zeros(SHAPE, np.float32), np.zeros(SHAPE, np.float32)
    share = np.float32(4 / len(samples))
    for inverse_depth, identity, distance in samples:
        receive(inverse_depth, identity, distance.astype(np.float32), infrared * share, RAY_LENGTH2, real, imaginary)
    small = (SHAPE[1] // 8, SHAPE[0] // 8)
    detour = DETOUR * np.exp(1j * RADIANS_A_METRE * DETOUR_M)
    near_real, near_imaginary = (
        cv2.resize(
            cv2.GaussianBlur(cv2.resize(part, small, interpolation=cv2.INTER_AREA), (0, 0), 2.5),
            SHAPE[::-1],
            interpolation=cv2.INTER_LINEAR,
        )
        for part in (real, imaginary)
    )
    total_real = real + np.float32(detour.real) * near_real - np.float32(detour.imag) * near_imaginary
    total_imaginary = imaginary + np.float32(detour.imag) * near_real + np.float32(detour.real) * near_imaginary
    total_real += np.float32(STRAY * real.mean())
    total_imaginary += np.float32(STRAY * imaginary.mean())
    at = rng.integers(0, TILE, 4)
    out = np.empty(SHAPE, np.float32)
    decide(
        total_real,
        total_imaginary,
        tiles.white,
        (int(at[0]), int(at[1]), int(at[2]), int(at[3])),
        expected,
        RAY_LENGTH2,
        out,
    )
    return out
