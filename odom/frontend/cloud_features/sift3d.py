"""SIFT3D: where a cloud's brightness peaks in space and scale, found on the points themselves.

D. Lowe's detector (IJCV 60, 2004) carried from images to clouds, with the choices of the Point Cloud Library's
`SIFTKeypoint`, which the paper used: an octave is a grid twice as coarse, a Gaussian reaches as far as three sigmas,
and a key point stands out among its 25 nearest points at its own scale and both scales beside it.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from odom.frontend.cloud_features.cloud import Cloud
from odom.frontend.cloud_features.neighbourhood import Cells, near
from odom.frontend.cloud_features.tuning import TUNING
from odom.geometry.arrays import Array, Index
from odom.geometry.compiled import compiled

_REACH = 3.0
"""Sigmas beyond which a Gaussian counts as 0."""
_NEIGHBOURS = 25
"""Points, itself among them, in which a key point must be the extreme; a smaller cloud has none."""


@dataclass(frozen=True)
class ScaleSpace:
    """What is looked at: sigma of the first scale (m), octaves, scales in each, and the least contrast (0 to 255)."""

    sigma_m: float = TUNING.sift_sigma_m
    octaves: int = TUNING.sift_octaves
    scales: int = TUNING.sift_scales
    contrast: float = TUNING.sift_contrast


@dataclass(frozen=True, eq=False)
class KeyPoints:
    """n key points (n x 3, m), the mean colours there (n x 3) and the sigmas at which they stand out (n, m)."""

    points: Array
    colors: Array
    sigmas: Array


def sift3d(cloud: Cloud, space: ScaleSpace) -> KeyPoints:
    """Return the key points of a cloud, octave by octave; none where too few points are left."""
    found = []
    sigma_m = space.sigma_m
    for _ in range(space.octaves):
        cloud = cloud.thinned(sigma_m)
        if len(cloud) < _NEIGHBOURS:
            break
        sigmas = sigma_m * 2.0 ** ((np.arange(space.scales + 3) - 1.0) / space.scales)
        cells = Cells.of(cloud.points, _REACH * float(sigmas[-1]))
        responses = difference_of_gaussians(cloud.points, cloud.intensities, cells, sigmas, space.scales)
        rows, scales = _extrema(cloud.points, responses, space.contrast)
        found.append((cloud.points[rows], cloud.colors[rows], sigmas[scales]))
        sigma_m *= 2.0
    if not found:
        return KeyPoints(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    points, colors, at = zip(*found, strict=True)
    return KeyPoints(np.concatenate(points), np.concatenate(colors), np.concatenate(at))


@compiled
def difference_of_gaussians(points: Array, intensities: Array, cells: Cells, sigmas: Array, octave: int) -> Array:
    """Return the differences (n x s - 1) of the brightness smoothed by s Gaussians, each against the one before.

    Every `octave` Gaussians sigma is twice as large, so that a weight is the fourth power of a later one.
    """
    n, s = len(points), len(sigmas)
    out = np.empty((n, s - 1))
    found, squares = np.empty(n, np.int64), np.empty(n)
    sums, weights, w = np.empty(s), np.empty(s), np.empty(s)
    rate, reach = -0.5 / sigmas**2, (_REACH * sigmas) ** 2
    for i in range(n):
        count = near(points[i], points, cells, found, squares)
        sums[:] = 0.0
        weights[:] = 0.0
        for k in range(count):
            value, square = intensities[found[k]], squares[k]
            for j in range(s - 1, -1, -1):
                if square > reach[j]:
                    break
                w[j] = np.exp(rate[j] * square) if j + octave >= s else w[j + octave] ** 4
                sums[j] += w[j] * value
                weights[j] += w[j]
        for j in range(1, s):
            out[i, j - 1] = sums[j] / weights[j] - sums[j - 1] / weights[j - 1]
    return out


def _extrema(points: Array, responses: Array, contrast: float) -> tuple[Index, Index]:
    """Return rows and scales of the responses (n x s) that are extreme among their neighbours in space and scale."""
    nearest = KDTree(points).query(points, k=_NEIGHBOURS)[1]
    around = responses[nearest]
    lowest, highest = around.min(axis=1), around.max(axis=1)
    here = responses[:, 1:-1]
    least = (here == lowest[:, 1:-1]) & (here < lowest[:, :-2]) & (here < lowest[:, 2:])
    most = (here == highest[:, 1:-1]) & (here > highest[:, :-2]) & (here > highest[:, 2:])
    rows, scales = np.nonzero((np.abs(here) >= contrast) & (least | most))
    return rows, scales + 1
