"""Corners that the chain follows by itself, where the map knows none: by aligned patches, with sub-pixel precision.

A patch is never cut again: the errors of one frame's positions then enter two neighbouring links with opposite signs,
and the chain drifts less than if each frame had patches of its own.
"""

from dataclasses import dataclass, replace

import numpy as np

from odom.backend.chain.named_features import NamedFeatures
from odom.backend.chain.tuning import TUNING
from odom.backend.tracking.tuning import TUNING as TRACKING
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.corners import detect_corners
from odom.frontend.features.lens_change import LensChange
from odom.frontend.features.measurement import measure, measure_exactly, points_of
from odom.frontend.features.patches import RADIUS, cut_patches
from odom.frontend.features.view import View
from odom.frontend.matching.landmark_search import Candidates, LandmarkPatches, find_landmarks
from odom.geometry import se3
from odom.geometry.arrays import Array, Image, Index, Mask
from odom.geometry.numbered import places_of


@dataclass(frozen=True, eq=False)
class OwnCorners:
    """n corners by their `names` (n, negative), cut out of K frames at `T_chain_keyframe` (K x 4 x 4).

    `position` (n x 3, m) is in the chain's coordinates; `keyframe` (n) says which of the K frames saw a corner first,
    at `uv` (n x 2 px) on the surface `plane` (n x 3: inverse depth and its slope per pixel) with `patch_full`
    (n x 25 x 25); `missed` (n) counts the frames in a row in which it was not found since.
    """

    names: Index
    position: Array
    keyframe: Index
    uv: Array
    plane: Array
    patch_full: Image
    missed: Index
    T_chain_keyframe: Array

    @classmethod
    def nothing(cls) -> "OwnCorners":
        """Return the value for no corner."""
        none, side = np.zeros(0, dtype=np.int64), 2 * RADIUS + 1
        patches = np.zeros((0, side, side), dtype=np.uint8)
        return cls(none, np.zeros((0, 3)), none, np.zeros((0, 2)), np.zeros((0, 3)), patches, none, np.zeros((0, 4, 4)))

    def __len__(self) -> int:
        return len(self.names)

    def joined(self, new: "OwnCorners") -> "OwnCorners":
        """Return these corners followed by `new` ones."""
        return OwnCorners(
            np.concatenate([self.names, new.names]),
            np.concatenate([self.position, new.position]),
            np.concatenate([self.keyframe, new.keyframe + len(self.T_chain_keyframe)]),
            np.concatenate([self.uv, new.uv]),
            np.concatenate([self.plane, new.plane]),
            np.concatenate([self.patch_full, new.patch_full]),
            np.concatenate([self.missed, new.missed]),
            np.concatenate([self.T_chain_keyframe, new.T_chain_keyframe]),
        )

    def found_again(self, names: Index) -> "OwnCorners":
        """Return what is left after a frame in which the corners `names` (m) were found, and no others."""
        missed = np.where(places_of(self.names, names) >= 0, 0, self.missed + 1)
        return replace(self, missed=missed)._take(missed < TUNING.corner_misses)

    def with_lens_changed(self, change: LensChange) -> "OwnCorners":
        """Return the corners as they would have been measured through a new lens."""
        T_keyframe_chain = se3.inverses(self.T_chain_keyframe)[self.keyframe]
        position, ratio = change.positions(self.position, self.plane[:, 1:], T_keyframe_chain)
        return replace(self, position=position, plane=np.column_stack([self.plane[:, 0] * ratio, self.plane[:, 1:]]))

    def look_for(self, view: View, T_camera_chain: Array, twist: Array, sensor: SensorModel) -> NamedFeatures:
        """Return those that a view shows close to where the pose `T_camera_chain` expects them.

        The camera moves with `twist` (6, SI, its own frame).
        """
        n = len(self)
        if not n:
            return NamedFeatures.nothing()
        T_camera_keyframe = T_camera_chain @ self.T_chain_keyframe
        candidates = Candidates.all_of(np.arange(n), np.arange(len(T_camera_keyframe)), T_camera_keyframe)
        none = self.patch_full[:0]  # so near to where they are expected the half-size image is not searched
        patches = LandmarkPatches(self.position, self.keyframe, self.uv, self.plane, self.patch_full, none)
        found = find_landmarks(patches, candidates, T_camera_chain, twist, view.images, sensor, n, is_near=True)
        covariance_uv = found.covariance_uv * TRACKING.image_noise**2
        measured = measure(view, sensor, found.uv, covariance_uv, twist, found.inverse_depth)
        return NamedFeatures(self.names[found.rows], found.uv, measured)

    def _take(self, kept: Mask) -> "OwnCorners":
        if kept.all():
            return self
        used, keyframe = np.unique(self.keyframe[kept], return_inverse=True)
        return OwnCorners(
            self.names[kept],
            self.position[kept],
            keyframe.astype(np.int64),
            self.uv[kept],
            self.plane[kept],
            self.patch_full[kept],
            self.missed[kept],
            self.T_chain_keyframe[used],
        )


def cut_corners(
    view: View, known_uv: Array, T_chain_camera: Array, first_name: int, twist: Array, sensor: SensorModel
) -> tuple[OwnCorners, NamedFeatures]:
    """Return corners with depth away from the features at `known_uv` (m x 2 px), and what the view measures of them.

    They are named `first_name`, `first_name` - 1 and so on. They are detected in the half-size image, which takes a
    third of the time: where exactly a patch is cut does not matter.
    """
    uv = 2.0 * detect_corners(view.images.half, known_uv / 2.0, TUNING.corner_cell_px // 2)
    uv = uv[view.stands(uv)]
    measured = measure_exactly(view, sensor, uv, twist)
    deep = measured.values[:, 2] > 1.0 / TUNING.corner_farthest_m
    uv, measured = uv[deep], measured.take(deep)
    n = len(uv)
    names, zeros = first_name - np.arange(n), np.zeros(n, dtype=np.int64)
    position = se3.apply(T_chain_camera, points_of(measured)[0])
    plane = np.column_stack([measured.values[:, 2], measured.slope])
    patches = cut_patches(view.images.full, uv)
    corners = OwnCorners(names, position, zeros, uv, plane, patches, zeros, T_chain_camera[None])
    return corners, NamedFeatures(names, uv, measured)
