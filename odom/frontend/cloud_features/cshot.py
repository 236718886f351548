"""CSHOT: the surface and the colours around a point, as one histogram of 1344 numbers.

Shape: F. Tombari, S. Salti and L. Di Stefano, ECCV 2010; colour: the same, "A combined texture-shape descriptor for
enhanced 3D feature matching", ICIP 2011. The ball around a point is cut into 32 volumes: 8 in azimuth, 2 in elevation,
2 in radius. In each, 11 bins count the cosines between the points' normals and the frame's z axis (352 numbers), and 31
bins the differences of their colours from the point's own in CIELab (992). A point counts in its own bin and, by its
distance from the bins' middles, in the nearest bin along each of the four axes.
"""

import numpy as np
from numpy.typing import NDArray

from odom.frontend.cloud_features.cloud import Cloud
from odom.frontend.cloud_features.neighbourhood import Cells, near
from odom.frontend.cloud_features.reference_frame import LEAST_POINTS, reference_frames
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled

SHAPE_BINS, COLOR_BINS = 11, 31
"""Bins a volume: cosines of normals, and differences of colour."""
_VOLUMES = 32
"""8 azimuths x 2 radii x 2 elevations, the elevation varying fastest."""
LENGTH = _VOLUMES * (SHAPE_BINS + COLOR_BINS)
"""Numbers of a descriptor: 352 of shape, then 992 of colour."""
_WHITE = np.array([0.95047, 1.0, 1.08883])
"""CIE XYZ of the white point D65."""
_XYZ_OF_RGB = np.array([[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]])
"""CIE XYZ of linear red, green and blue (ITU-R BT.709 primaries)."""
_LAB_RANGE = np.array([100.0, 120.0, 120.0])
"""What lightness and the two colour axes are measured by; beyond it they are cut."""


def describe(surface: Cloud, normals: Array, points: Array, colors: Array, radius_m: float) -> NDArray[np.float32]:
    """Return the descriptors (n x 1344, of length 1) of n points (n x 3, m) of these colours (n x 3) on a surface.

    `normals` (n x 3) are the surface's, NaN where it has none: such points say nothing. A row is NaN where fewer than
    five points lie within `radius_m`.
    """
    cells = Cells.of(surface.points, radius_m)
    frames = reference_frames(points, surface.points, cells)
    out = np.zeros((len(points), LENGTH), dtype=np.float32)
    fill(points, lab(colors), frames, surface.points, lab(surface.colors), normals, cells, out)
    norm = np.linalg.norm(out, axis=1)
    out /= np.where(norm > 0.0, norm, np.nan)[:, None].astype(np.float32)
    return out


def lab(colors: Array) -> Array:
    """Return red, green and blue (n x 3, 0 to 255) in CIELab, lightness from 0 to 1, the others from -1 to 1."""
    stored = np.clip(np.rint(colors), 0, 255) / 255.0
    linear = np.where(stored > 0.04045, ((stored + 0.055) / 1.055) ** 2.4, stored / 12.92)
    ratio = linear @ _XYZ_OF_RGB.T / _WHITE
    root = np.where(ratio > 0.008856, np.cbrt(ratio), 7.787 * ratio + 16.0 / 116.0)
    out = np.column_stack(
        [116.0 * root[:, 1] - 16.0, 500.0 * (root[:, 0] - root[:, 1]), 200.0 * (root[:, 1] - root[:, 2])]
    )
    return np.asarray(np.clip(out / _LAB_RANGE, -1.0, 1.0))


@compiled
def fill(
    centres: Array,
    labs: Array,
    frames: Array,
    points: Array,
    surface_labs: Array,
    normals: Array,
    cells: Cells,
    out: NDArray[np.float32],
) -> None:
    """Add up the histograms (n x 1344) of n centres; NaN where a frame is, or where too few points are near."""
    found, squares = np.empty(len(points), np.int64), np.empty(len(points))
    half = 0.5 * cells.radius_m
    for n in range(len(centres)):
        count = near(centres[n], points, cells, found, squares)
        if count < LEAST_POINTS or not np.isfinite(frames[n, 0, 0]):
            out[n] = np.nan
            continue
        for k in range(count):
            i, r = found[k], np.sqrt(squares[k])
            if r == 0.0 or not np.isfinite(normals[i, 0]):
                continue
            x = y = z = cosine = 0.0
            for a in range(3):
                step = points[i, a] - centres[n, a]
                x += step * frames[n, 0, a]
                y += step * frames[n, 1, a]
                z += step * frames[n, 2, a]
                cosine += normals[i, a] * frames[n, 2, a]
            color = abs(labs[n, 0] - surface_labs[i, 0])
            color += 0.5 * (abs(labs[n, 1] - surface_labs[i, 1]) + abs(labs[n, 2] - surface_labs[i, 2]))
            # the volume, and how far from its middle the point is in widths of a volume, along three axes
            azimuth = (np.arctan2(y, x) + np.pi) / (0.25 * np.pi)
            sector = min(7, int(azimuth))
            aside = azimuth - sector - 0.5
            outer = 1 if r > half else 0
            beyond = r / half - 0.5 - outer
            upper = 1 if z > 0.0 else 0
            below = np.arccos(min(1.0, max(-1.0, z / r))) / (0.5 * np.pi) - 1.5 + upper
            volume = 4 * sector + 2 * outer + upper
            own = (1.0 - abs(aside)) + (1.0 - abs(beyond)) + (1.0 - abs(below))
            next_sector = (4 * (sector + (1 if aside > 0.0 else -1)) + 2 * outer + upper) % _VOLUMES
            has_radial = (beyond > 0.0) != (outer == 1)
            next_radial = 4 * sector + 2 * (1 - outer) + upper
            has_vertical = (below > 0.0) == (upper == 1)
            next_vertical = 4 * sector + 2 * outer + 1 - upper
            for channel in range(2):
                bins = SHAPE_BINS if channel == 0 else COLOR_BINS
                begin = 0 if channel == 0 else _VOLUMES * SHAPE_BINS
                level = 0.5 * (1.0 + min(1.0, max(-1.0, cosine))) if channel == 0 else min(1.0, color / 3.0)
                at = level * (bins - 1)
                bin_ = int(at + 0.5)
                off = at - bin_
                out[n, begin + volume * bins + bin_] += own + 1.0 - abs(off)
                if off != 0.0:
                    out[n, begin + volume * bins + bin_ + (1 if off > 0.0 else -1)] += abs(off)
                out[n, begin + next_sector * bins + bin_] += abs(aside)
                if has_radial:
                    out[n, begin + next_radial * bins + bin_] += abs(beyond)
                if has_vertical:
                    out[n, begin + next_vertical * bins + bin_] += abs(below)
