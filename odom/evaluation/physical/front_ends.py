"""Point pairs between two frames of a camera by each of three front-ends, at the times of the two stamps."""

from dataclasses import dataclass
from enum import Enum, unique
from functools import cached_property

import cv2
import numpy as np

from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.cloud_features.cloud import cloud_of
from odom.frontend.cloud_features.matching import CloudFeatures, cloud_features, match_features
from odom.frontend.cloud_features.tuning import TUNING
from odom.frontend.features.image_scale import scaled_image
from odom.frontend.features.measurement import measure, measure_exactly, points_of
from odom.frontend.features.patches import PATCH_LIMITS, UNWARPED, align_patches, cut_patches
from odom.frontend.features.place_descriptor import Place, describe_place
from odom.frontend.features.view import View
from odom.frontend.matching.optical_flow import follow_there_and_back
from odom.frontend.matching.place_recognition import match_places
from odom.geometry import se3
from odom.geometry.arrays import Array, Image
from odom.registration import Pairs

_THERE_AND_BACK_PX = 1.0
"""A corner followed to the other image and back must end where it began, but for this."""
_GREY_NOISE = 8.0
"""Standard deviation of a corner's patch in grey levels, of an image in motion: it makes the places of corners as
uncertain as the arena's pairs show against truth (.15, .5, 1.0 px stated, .14, .6, .93 px shown; both Kinects). Less
makes weak corners count too much for RF and KF; more, only strong ones."""
_ORB_PX = 0.35
"""Standard deviation of an ORB feature's place at full scale, for looks a quarter of a second apart: what the arena's
pairs show against truth (.5, .7, 1.2, 1.8 px stated by scale, .52, .7, 1.13, 1.62 px shown; both Kinects). More makes
RF and KF trust depth against pixels: with 1 px, KF is behind EM-ICP; less takes right pairs for wrong ones."""
_STEPS = 10
"""Gauss-Newton steps of an alignment at most: most need three."""
_PICTURE_PX = 320
"""Width of an image in the figure."""
_NO_PAIRS = Pairs(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3, 3)))


@unique
class FrontEnd(Enum):
    """Where correspondences come from."""

    FOLLOWED = "corners followed"
    ORB = "ORB"
    SIFT3D = "SIFT3D + CSHOT"


@dataclass(frozen=True, eq=False)
class Look:
    """A key pose: its `view`, the camera's colour image (h x w x 3), and its `twist` then (6, SI, camera frame).

    `sensor` is what the whole stream has shown of the camera.
    """

    view: View
    color: Image
    twist: Array
    sensor: SensorModel

    @cached_property
    def T_stamp_middle(self) -> Array:
        """Maps points from the camera at its middle row, for which pixels are measured, to the camera at the stamp."""
        return se3.exp(-self.twist * self.view.since_middle_s(self.sensor.timing))

    @cached_property
    def place(self) -> Place:
        """ORB features with their points, at the middle row's time."""
        return describe_place(self.view, self.sensor, self.twist, _ORB_PX)

    @cached_property
    def features(self) -> CloudFeatures:
        """SIFT3D key points and CSHOT descriptors, at the time of the depth image."""
        color = scaled_image(self.color, self.view.images.scale)
        return cloud_features(cloud_of(color, self.view.depth_mm, self.sensor.lens.rays))

    @cached_property
    def T_stamp_depth(self) -> Array:
        """The same from the depth image's middle row."""
        since_s = self.view.stamp - self.view.depth_stamp
        return se3.exp(-self.twist * (since_s * 1e-9 - self.sensor.timing.depth_lag_s))


def pairs_by(front_end: FrontEnd, source: Look, target: Look, followed: tuple[Array, Array] | None = None) -> Pairs:
    """Return the pairs of `source` and `target` that a front-end finds; possibly none.

    `followed` holds corners in the target's image (n x 2 px) and where following them through the frames between ended
    in the source's image: the start for FOLLOWED, which finds nothing without it.
    """
    match front_end:
        case FrontEnd.FOLLOWED:
            found = _NO_PAIRS if followed is None else _followed(source, target, *followed)
            carried = source.T_stamp_middle, target.T_stamp_middle
        case FrontEnd.ORB:
            found = match_places(source.place, target.place) or _NO_PAIRS
            carried = source.T_stamp_middle, target.T_stamp_middle
        case FrontEnd.SIFT3D:
            found = _clouds(source, target)
            carried = source.T_stamp_depth, target.T_stamp_depth
    T_source, T_target = carried
    assert found.covariances_source is not None
    assert found.covariances_target is not None
    return Pairs(
        se3.apply(T_source, found.points_source),
        se3.apply(T_target, found.points_target),
        T_source[:3, :3] @ found.covariances_source @ T_source[:3, :3].T,
        T_target[:3, :3] @ found.covariances_target @ T_target[:3, :3].T,
    )


def _followed(source: Look, target: Look, uv_target: Array, uv_guess: Array) -> Pairs:
    """Return the corners found again from image to image, and back, with the depth that both images have.

    Their patches are aligned, which gives each corner the covariance that its own texture allows.
    """
    there, back = target.view.images.full, source.view.images.full
    scale = source.view.images.scale
    uv_source, kept = follow_there_and_back(there, back, uv_target, uv_guess, _THERE_AND_BACK_PX, scale)
    straight = np.tile(UNWARPED, (len(kept), 1, 1))
    patches = cut_patches(there, uv_target)
    score, covariance = align_patches(
        back, patches, np.arange(len(kept)), straight, uv_source, kept, _STEPS, _THERE_AND_BACK_PX, PATCH_LIMITS
    )
    kept = score > 0.0
    first = measure(source.view, source.sensor, uv_source[kept], covariance[kept] * _GREY_NOISE**2, source.twist)
    second = measure_exactly(target.view, target.sensor, uv_target[kept], target.twist)
    deep = (first.values[:, 2] > 0.0) & (second.values[:, 2] > 0.0)
    points_source, covariances_source = points_of(first.take(deep))
    points_target, covariances_target = points_of(second.take(deep))
    return Pairs(points_source, points_target, covariances_source, covariances_target)


def _clouds(source: Look, target: Look) -> Pairs:
    a, b = match_features(source.features, target.features)
    one, other = source.features, target.features
    return Pairs(
        one.points[a],
        other.points[b],
        _key_point_covariances(one.points[a], one.sigmas[a], source.sensor),
        _key_point_covariances(other.points[b], other.sigmas[b], target.sensor),
    )


def _key_point_covariances(points: Array, sigmas: Array, sensor: SensorModel) -> Array:
    """Return the covariances (n x 3 x 3) of key points: depth's along the ray, plus an isotropic error of detection.

    The detection is off within a cube of the grid, by more for coarser scales and farther points.
    """
    z = points[:, 2]
    knots, sigma = sensor.noise.feature_noise.inverse_depth_sigma
    ray = points / z[:, None] * (z**2 * np.interp(1.0 / z, knots, sigma))[:, None]
    found = TUNING.sift_sigma_m**2 / 12.0 + (TUNING.key_point_share * sigmas) ** 2 + (TUNING.key_point_rad * z) ** 2
    return np.asarray(ray[:, :, None] * ray[:, None, :] + found[:, None, None] * np.eye(3))


def small_picture(color: Image) -> Image:
    """Return an RGB image made narrower for the figure."""
    height = round(color.shape[0] * _PICTURE_PX / color.shape[1])
    return np.asarray(cv2.resize(color, (_PICTURE_PX, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
