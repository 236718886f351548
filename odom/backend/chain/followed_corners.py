"""Corners of one frame found again in the next, where patches that were cut earlier match too few.

In a fast turn two successive images are blurred alike: where a sharp patch does not match, one cut from the image
before still does.
"""

import numpy as np

from odom.backend.chain.chain_frame import ChainFrame
from odom.backend.chain.named_features import NamedFeatures
from odom.backend.chain.own_corners import cut_corners
from odom.backend.chain.tuning import TUNING
from odom.backend.tracking.tuning import TUNING as TRACKING
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.measurement import measure
from odom.frontend.features.patches import PATCH_LIMITS, UNWARPED, align_patches
from odom.frontend.matching.optical_flow import follow_there_and_back
from odom.frontend.matching.tuning import TUNING as SEARCH
from odom.geometry import se3
from odom.geometry.arrays import Array


def follow_corners(
    previous: ChainFrame, current: ChainFrame, known_uv: Array, T_hint: Array, first_name: int, sensor: SensorModel
) -> tuple[NamedFeatures, NamedFeatures]:
    """Return what two frames measure of corners that both show, away from features at `known_uv` (m x 2 px) in one.

    They are followed from the `previous` image to where `T_hint`, an expected T_previous_current, puts them, and back.
    They are named `first_name`, `first_name` - 1 and so on.
    """
    images = previous.view.images.full, current.view.images.full
    corners, seen = cut_corners(previous.view, known_uv, np.eye(4), first_name, previous.twist, sensor)
    expected = sensor.lens.project(corners.position, se3.inverse(T_hint))
    in_view = np.flatnonzero(expected[:, 2] > 0.0)
    begin, guess, scale = corners.uv[in_view], expected[in_view, :2], current.view.images.scale
    uv, kept = follow_there_and_back(*images, begin, guess, TUNING.followed_back_px, scale)
    unwarped = np.tile(UNWARPED, (len(in_view), 1, 1))
    score, covariance_uv = align_patches(
        images[1],
        corners.patch_full,
        in_view,
        unwarped,
        uv,
        kept,
        SEARCH.search_iterations,
        SEARCH.search_fine_limit_px,
        PATCH_LIMITS,
    )
    found = np.flatnonzero(score > SEARCH.search_fine_score)
    before = seen.take(in_view[found])
    covariance = covariance_uv[found] * TRACKING.image_noise**2
    return before, NamedFeatures(
        before.names, uv[found], measure(current.view, sensor, uv[found], covariance, current.twist)
    )
