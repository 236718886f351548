"""Landmarks of a key frame as another one sees them, so that they stay when the one that saw them first goes."""

from dataclasses import fields

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.backend.map.saved import SavedLandmarks
from odom.frontend.camera.lens import Lens
from odom.frontend.features.patch_warp import at_half_size, homographies
from odom.frontend.features.patches import RADIUS
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask

_CENTRE = np.array([RADIUS, RADIUS], dtype=np.float64)


def take(landmarks: SavedLandmarks, chosen: Mask) -> SavedLandmarks:
    """Return the chosen ones."""
    return SavedLandmarks(*(getattr(landmarks, f.name)[chosen] for f in fields(landmarks)))


def joined(one: SavedLandmarks, other: SavedLandmarks) -> SavedLandmarks:
    """Return the landmarks of both, in this order."""
    return SavedLandmarks(*(np.concatenate([getattr(one, f.name), getattr(other, f.name)]) for f in fields(one)))


def seen_from(landmarks: SavedLandmarks, T_new_old: Array, lens: Lens) -> SavedLandmarks:
    """Return those of n landmarks that another key frame sees well enough, in its camera frame, patches warped.

    `T_new_old` is the motion from the key frame that saw them first. Left out are those out of the other's image,
    seen from behind, too steeply, or from much farther or nearer.
    """
    at = lens.project(landmarks.position, T_new_old)
    nobody = np.zeros(len(at), dtype=np.int64)
    H_old_new, usable = homographies(landmarks.uv, landmarks.plane, nobody, T_new_old[None], lens)
    chosen = usable & np.isfinite(at[:, 0])
    kept, H = take(landmarks, chosen), H_old_new[chosen]
    R = T_new_old[:3, :3]
    return SavedLandmarks(
        kept.identity,
        se3.apply(T_new_old, kept.position),
        R @ kept.covariance @ R.T,
        at[chosen, :2],
        _planes(kept, T_new_old, lens),
        _warped(kept.patch_full, H),
        _warped(kept.patch_half, at_half_size(H)),
        kept.seen,
        kept.tried,
        kept.assumed,
    )


def _planes(landmarks: SavedLandmarks, T_new_old: Array, lens: Lens) -> Array:
    """Return inverse depth and slopes (n x 3) of the surfaces in another camera, for a lens that is linear nearby.

    A surface n' X = 1 has the inverse depth n' (x, y, 1) at the ray (x, y).
    """
    f = lens.intrinsics[:2]
    slope, position = landmarks.plane[:, 1:] * f, landmarks.position
    ray = position[:, :2] / position[:, 2:]
    n_old = np.column_stack([slope, 1.0 / position[:, 2] - np.sum(slope * ray, axis=1)])
    n_new = n_old @ T_new_old[:3, :3].T
    n_new /= 1.0 + n_new @ T_new_old[:3, 3:]
    return np.column_stack([1.0 / se3.apply(T_new_old, position)[:, 2], n_new[:, :2] / f])


def _warped(patches: NDArray[np.uint8], H_old_new: Array) -> NDArray[np.uint8]:
    """Return patches (n x side x side) of which `H_old_new` (n x 3 x 2) maps an offset to one in the old ones."""
    out = np.empty_like(patches)
    centred, back = np.eye(3), np.eye(3)
    centred[:2, 2], back[:2, 2] = -_CENTRE, _CENTRE
    for k, H in enumerate(H_old_new):
        to_old = back @ np.column_stack([H, [0.0, 0.0, 1.0]]) @ centred
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        out[k] = cv2.warpPerspective(patches[k], to_old, patches[k].shape, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return out
