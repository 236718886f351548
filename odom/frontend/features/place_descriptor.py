"""What a place looks like: a frame's ORB features with their 3-D points."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.measurement import measure, points_of
from odom.frontend.features.tuning import TUNING
from odom.frontend.features.view import View
from odom.geometry.arrays import Array, rounded

Descriptors = NDArray[np.uint8]

_ORB_PATCH_PX = 31.0
"""Side of an ORB patch at full scale (E. Rublee et al., 2011); a feature of a coarser scale is that much less exact."""


@dataclass(frozen=True, eq=False)
class Place:
    """n features of one frame: ORB descriptors (n x 32), points (n x 3, m, camera frame), covariances (n x 3 x 3)."""

    descriptors: Descriptors
    points: Array
    covariances: Array

    def rounded(self) -> "Place":
        """Return the place in numbers of 24 bits, its covariances exactly symmetric."""
        symmetric = 0.5 * (self.covariances + self.covariances.swapaxes(1, 2))
        return Place(self.descriptors, rounded(self.points), rounded(symmetric))


def describe_place(
    view: View, sensor: SensorModel, twist: Array, sigma_px: float = 1.0, around: Array | None = None
) -> Place:
    """Return the place that a view shows, seen while moving with `twist` (6, SI, camera frame).

    With `around` (n x 2 px), features are taken only around these points of the image.

    `sigma_px` is the standard deviation of a feature's place at full scale, beyond the sensor's own noise. The default
    is careful: seconds and half a metre apart, the arena's truth shows .6 px, but neighbouring features share errors,
    and with less than 1 px registrations of places would be surer still than they are (NEES 12 to 16). Features without
    depth are left out. ORB: E. Rublee et al., ICCV 2011.
    """
    orb = cv2.ORB.create(
        nfeatures=TUNING.place_features, scaleFactor=TUNING.place_scale, fastThreshold=TUNING.place_fast_threshold
    )
    keypoints, descriptors = orb.detectAndCompute(view.images.full, None if around is None else _around(around, view))
    if descriptors is None:
        return Place(np.zeros((0, 32), np.uint8), np.zeros((0, 3)), np.zeros((0, 3, 3)))
    uv = np.array([k.pt for k in keypoints], dtype=np.float64)
    variance = np.array([sigma_px * k.size / _ORB_PATCH_PX for k in keypoints]) ** 2
    covariance_uv = np.stack([variance, np.zeros_like(variance), variance], axis=1)
    measured = measure(view, sensor, uv, covariance_uv, twist)
    deep = (measured.values[:, 2] > 0.0) & view.stands(uv)
    points, covariances = points_of(measured.take(deep))
    return Place(np.asarray(descriptors, dtype=np.uint8)[deep], points, covariances)


def _around(uv: Array, view: View) -> NDArray[np.uint8]:
    """Return the mask (H x W) of a view's pixels that are near any of n points (n x 2 px)."""
    mask = np.zeros(view.images.full.shape, dtype=np.uint8)
    for u, v in uv.round().astype(int).tolist():
        cv2.circle(mask, (u, v), TUNING.place_around_px, 255, cv2.FILLED)
    return mask
