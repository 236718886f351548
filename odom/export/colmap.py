"""COLMAP's sparse model, binary and text: cameras, images with their keypoints, points with their tracks.

Format: https://colmap.github.io/format.html. COLMAP's pixels have their centres at half numbers, its images are posed
by T_camera_map.
"""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from odom.export.views import View
from odom.frame import Camera
from odom.geometry import se3
from odom.geometry.arrays import Array, Index

_PINHOLE = 1
"""COLMAP's number of the camera model PINHOLE (fx, fy, cx, cy)."""
_MOST_PX = 4.0
"""Keypoints farther from their point's projection are no part of its track: COLMAP's own bound."""


@dataclass(frozen=True, eq=False)
class ColmapImage:
    """An image: T_camera_map, keypoints `uv` (n x 2, COLMAP's pixels) and their points' ids (n; -1: none)."""

    name: str
    T_camera_map: Array
    uv: Array
    point_ids: Index


@dataclass(frozen=True, eq=False)
class ColmapModel:
    """A pinhole camera, its images (numbers from 1), its points (ids from 1) with colours (uint8) and errors (px)."""

    camera: Camera
    images: tuple[ColmapImage, ...]
    points: Array
    colors: NDArray[np.uint8]
    errors: Array

    def tracks(self) -> list[list[tuple[int, int]]]:
        """Return for each point the numbers of the images that saw it, with the numbers of the keypoints there."""
        tracks: list[list[tuple[int, int]]] = [[] for _ in self.points]
        for number, image in enumerate(self.images, 1):
            for k in np.flatnonzero(image.point_ids > 0):
                tracks[image.point_ids[k] - 1].append((number, int(k)))
        return tracks


@dataclass(frozen=True, eq=False)
class Sighting:
    """What the model needs of a view, without its image: `colors` (n x 3) are those of its keypoints."""

    name: str
    T_map_camera: Array
    landmarks: Index
    uv: Array
    colors: NDArray[np.uint8]

    @classmethod
    def of(cls, view: View) -> "Sighting":
        """Return what remains of a view when its image is written."""
        height, width = view.color.shape[:2]
        inside = ((view.uv > -0.5) & (view.uv < [width - 0.5, height - 0.5])).all(axis=1)
        uv = view.uv[inside]
        u, v = np.rint(uv).astype(int).T
        return cls(f"{view.name}.jpg", view.T_map_camera, view.landmarks[inside], uv, view.color[v, u])


def model_of(camera: Camera, sightings: list[Sighting], points: Array) -> ColmapModel:
    """Return the model of a pinhole camera's sightings of `points` (m x 3, map): points seen in two images or more."""
    T = [se3.inverse(sighting.T_map_camera) for sighting in sightings]
    errors = [_errors(camera, T_one, one, points) for T_one, one in zip(T, sightings, strict=True)]
    count, total = np.zeros(len(points)), np.zeros(len(points))
    colors = np.zeros((len(points), 3))
    for one, error in zip(sightings, errors, strict=True):
        rows = one.landmarks[error < _MOST_PX]
        np.add.at(count, rows, 1)
        np.add.at(total, rows, error[error < _MOST_PX])
        np.add.at(colors, rows, one.colors[error < _MOST_PX])
    kept = np.flatnonzero(count > 1)
    ids = np.full(len(points), -1)
    ids[kept] = 1 + np.arange(len(kept))
    images = tuple(
        ColmapImage(one.name, T_one, one.uv + 0.5, np.where(error < _MOST_PX, ids[one.landmarks], -1))
        for T_one, one, error in zip(T, sightings, errors, strict=True)
    )
    mean = (colors[kept] / count[kept, None]).round().astype(np.uint8)
    return ColmapModel(camera, images, points[kept], mean, total[kept] / count[kept])


def _errors(camera: Camera, T_camera_map: Array, sighting: Sighting, points: Array) -> Array:
    seen = se3.apply(T_camera_map, points[sighting.landmarks])
    uv = seen[:, :2] / seen[:, 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
    return np.where(seen[:, 2] > 0, np.linalg.norm(uv - sighting.uv, axis=1), np.inf)


def text_files(model: ColmapModel) -> dict[str, str]:
    """Return cameras.txt, images.txt and points3D.txt."""
    cameras = f"1 PINHOLE {model.camera.width} {model.camera.height} {_numbers(_intrinsics(model.camera))}\n"
    images, points = [], []
    for number, image in enumerate(model.images, 1):
        keypoints = [f"{u:.6f} {v:.6f} {i}" for (u, v), i in zip(image.uv, image.point_ids, strict=True)]
        images.append(f"{number} {_numbers(_pose(image.T_camera_map))} 1 {image.name}\n{' '.join(keypoints)}\n")
    for number, track in enumerate(model.tracks(), 1):
        xyz, rgb, error = model.points[number - 1], model.colors[number - 1], model.errors[number - 1]
        seen = " ".join(f"{image} {keypoint}" for image, keypoint in track)
        points.append(f"{number} {_numbers(xyz)} {' '.join(map(str, rgb))} {error:.6f} {seen}\n")
    return {"cameras.txt": cameras, "images.txt": "".join(images), "points3D.txt": "".join(points)}


def binary_files(model: ColmapModel) -> dict[str, bytes]:
    """Return cameras.bin, images.bin and points3D.bin."""
    camera = model.camera
    cameras = struct.pack("<QiiQQ4d", 1, 1, _PINHOLE, camera.width, camera.height, *_intrinsics(camera))
    images = [struct.pack("<Q", len(model.images))]
    for number, image in enumerate(model.images, 1):
        keypoints = np.zeros(len(image.uv), dtype=[("uv", "<f8", 2), ("id", "<i8")])
        keypoints["uv"], keypoints["id"] = image.uv, image.point_ids
        head = struct.pack("<i7di", number, *_pose(image.T_camera_map), 1)
        images.append(head + image.name.encode() + b"\0" + struct.pack("<Q", len(image.uv)) + keypoints.tobytes())
    points = [struct.pack("<Q", len(model.points))]
    for number, track in enumerate(model.tracks(), 1):
        xyz, rgb, error = model.points[number - 1], model.colors[number - 1], model.errors[number - 1]
        points.append(struct.pack("<Q3d3BdQ", number, *xyz, *rgb.tolist(), error, len(track)))
        points.append(np.array(track, dtype="<i4").tobytes())
    return {"cameras.bin": cameras, "images.bin": b"".join(images), "points3D.bin": b"".join(points)}


def _intrinsics(camera: Camera) -> tuple[float, float, float, float]:
    return camera.fx, camera.fy, camera.cx + 0.5, camera.cy + 0.5


def _pose(T: Array) -> Array:
    """Return `qw qx qy qz tx ty tz`."""
    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
    return np.array([w, x, y, z, *T[:3, 3]])


def _numbers(values: "Array | tuple[float, ...]") -> str:
    return " ".join(f"{value:.9f}" for value in values)
