"""Depth as a Kinect v2 measures it: the phase of modulated light that comes back, from all that a pixel receives.

The chain is simulated: each pixel adds up the light of four samples of its footprint (so depth flies between near and
far at edges), of the lens's own stray light and of the light that takes a detour over the surroundings (so corners seem
rounder and near things pull far ones), with photon noise against ambient light; the phase of that sum is the depth.
"""

import cv2
import numpy as np

from odom.frame import Camera
from odom.geometry.compiled import compiled
from sensors.arena.array_types import Float32
from sensors.arena.noise_tiles import TILE, Tiles
from sensors.arena.renderer import DepthView

INFRARED = Camera(512, 424, 365.5, 365.5, 255.5, 207.5)
"""The infrared camera, pixels: a typical calibration, as a Kinect v2 stores it."""
SHAPE = (INFRARED.height, INFRARED.width)
T_COLOR_INFRARED = np.array([[1, 0, 0, -0.052], [0, 1, 0, 0.0], [0, 0, 1, 0.0], [0, 0, 0, 1.0]])
"""The infrared camera sits 52 mm left of the colour camera, as in the device."""
MODULATION_HZ = 80e6
"""The middle one of the sensor's three frequencies; the others only settle its whole turns."""
SPEED_OF_LIGHT = 299_792_458.0
"""Metres a second."""
RADIANS_PER_METRE = 4 * np.pi * MODULATION_HZ / SPEED_OF_LIGHT
"""Phase by which light comes back later for each metre of distance, there and back."""
STRAY = 0.006
"""Share of all light that the lens spreads over the image: larger pulls dark things towards the mean depth."""
DETOUR = 0.025
"""Share of its neighbourhood's light that a surface receives and sends back on a detour: larger rounds corners more."""
DETOUR_M = 0.25
"""How much longer that way is, metres: with DETOUR the outward bias of 1 to 20 mm at 2 m (test_arena_depth.py)."""
AMBIENT = 0.02
"""Other light, relative to the sensor's own from a white surface at 1 m: more means more noise far away."""
PHOTONS = 9e4
"""Electrons at 1 m from a white surface that faces the camera: four times as many halve the noise."""
NEAREST_M, FARTHEST_M = 0.5, 4.8
"""Range of the sensor, metres; what is outside is 0."""
LEAST_AMPLITUDE = 0.011
"""Light, relative to that of a white surface at 1 m, below which there is no depth: larger shortens the range."""


def _ray_length2() -> Float32:
    x = (np.arange(INFRARED.width) - INFRARED.cx) / INFRARED.fx
    y = (np.arange(INFRARED.height) - INFRARED.cy) / INFRARED.fy
    return np.asarray(1 + x[None, :] ** 2 + y[:, None] ** 2, np.float32)


RAY_LENGTH2 = _ray_length2()


@compiled
def receive(view: DepthView, infrared: Float32, ray_length2: Float32, real: Float32, imaginary: Float32) -> None:
    """Add to the two parts of each pixel's phasor what one sample of its footprint sends back (a quarter each)."""
    inverse_depth, identity, distance = view
    height, width = inverse_depth.shape
    turn = np.float32(RADIANS_PER_METRE)
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
    real: Float32,
    imaginary: Float32,
    grain: Float32,
    at: tuple[int, ...],
    expected: Float32,
    ray_length2: Float32,
    out: Float32,
) -> None:
    """Turn phasors into depth along the optical axis (m); `expected` (1/m) only settles the whole turns.

    `grain` is a tile of white noise, used from `at` on.
    """
    height, width = real.shape
    mask = TILE - 1
    turn = np.float32(RADIANS_PER_METRE)
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
    expected: Float32, samples: list[DepthView], infrared: Float32, tiles: Tiles, rng: np.random.Generator
) -> Float32:
    """Return the depth image (m, 0 unknown) of the pixels' footprints, each sample as `Renderer.depth` gives it.

    `expected` (inverse depth at the pixels' middles) takes the place of the other modulation frequencies.
    """
    real, imaginary = np.zeros(SHAPE, np.float32), np.zeros(SHAPE, np.float32)
    share = np.float32(4 / len(samples))
    for view in samples:
        receive(view, infrared * share, RAY_LENGTH2, real, imaginary)
    small = (SHAPE[1] // 8, SHAPE[0] // 8)
    detour = DETOUR * np.exp(1j * RADIANS_PER_METRE * DETOUR_M)
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
    at = tuple(rng.integers(0, TILE, 4).tolist())
    out = np.empty(SHAPE, np.float32)
    decide(total_real, total_imaginary, tiles.white, at, expected, RAY_LENGTH2, out)
    return out
