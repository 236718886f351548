"""A cloud's key points with their descriptors, and which of them two clouds share."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.frontend.cloud_features.cloud import Cloud
from odom.frontend.cloud_features.cshot import describe
from odom.frontend.cloud_features.sift3d import ScaleSpace, sift3d
from odom.frontend.cloud_features.tuning import TUNING
from odom.geometry.arrays import Array, Index


@dataclass(frozen=True, eq=False)
class CloudFeatures:
    """n features of a cloud: points (n x 3, m), the sigmas they stand out at (n, m), CSHOT descriptors (n x 1344)."""

    points: Array
    sigmas: Array
    descriptors: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.points)


def cloud_features(cloud: Cloud) -> CloudFeatures:
    """Return the SIFT3D key points of a cloud with their CSHOT descriptors; about a second for a Kinect's cloud."""
    surface = cloud.thinned(TUNING.sift_sigma_m)
    found = sift3d(surface, ScaleSpace())
    normals = surface.normals(TUNING.normal_radius_m)
    descriptors = describe(surface, normals, found.points, found.colors, TUNING.cshot_radius_m)
    described = np.isfinite(descriptors[:, 0])
    return CloudFeatures(found.points[described], found.sigmas[described], descriptors[described])


def match_features(source: CloudFeatures, target: CloudFeatures) -> tuple[Index, Index]:
    """Return rows of `source` and of `target` that are each other's nearest by descriptor, and clearly so.

    Clearly: the nearest is at most `match_ratio` as far as the second nearest. None where either has fewer than two.
    """
    if min(len(source), len(target)) < 2:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    likeness = source.descriptors @ target.descriptors.T
    rows = np.arange(len(source))
    best = likeness.argmax(axis=1)
    second = np.partition(likeness, -2, axis=1)[:, -2]
    first = likeness[rows, best]
    is_mutual = likeness.argmax(axis=0)[best] == rows
    # squared distances of descriptors of length 1 are 2 - 2 likeness
    is_clear = 1.0 - first <= TUNING.match_ratio**2 * (1.0 - second)
    chosen = np.flatnonzero(is_mutual & is_clear)
    return chosen.astype(np.int64), best[chosen].astype(np.int64)
