"""The points of all key frames in one cloud, averaged within each voxel."""

import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera
from odom.geometry import se3
from odom.geometry.arrays import Array, Image, Mask

_AXIS_BITS = 21
"""Bits of a voxel's index along each axis: with voxels of 5 mm they reach over 10 km."""
_PENDING = 2_000_000
"""Voxels buffered before they are merged: a smaller buffer costs time, a larger one memory (this one some 150 MB)."""


def cloud_of(camera: Camera, depth_mm: NDArray[np.uint16], color: Image) -> tuple[Array, NDArray[np.uint8]]:
    """Return the points (n x 3, m, camera frame) of a pinhole camera's depth image and their colours (n x 3)."""
    v, u = np.nonzero(depth_mm)
    z = depth_mm[v, u] * 1e-3
    return np.column_stack([(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z]), color[v, u]


class VoxelCloud:
    """A growing cloud with one point a cube of side `voxel_m`: the mean of all in it, and of their colours."""

    def __init__(self, voxel_m: float) -> None:
        self._voxel_m = voxel_m
        self._keys: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self._sums: Array = np.zeros((0, 7))
        self._pending: list[tuple[NDArray[np.int64], Array]] = []
        self._waiting = 0

    def add(self, T_map_points: Array, points: Array, colors: NDArray[np.uint8]) -> None:
        """Add points (n x 3, m) with colours (n x 3); beyond a million cubes from the origin they are left out."""
        in_map = se3.apply(T_map_points, points)
        cubes = np.floor(in_map / self._voxel_m).astype(np.int64) + (1 << (_AXIS_BITS - 1))
        inside = self._in_range(cubes)
        cubes, in_map, colors = cubes[inside], in_map[inside], colors[inside]
        keys = (cubes[:, 0] << 2 * _AXIS_BITS) | (cubes[:, 1] << _AXIS_BITS) | cubes[:, 2]
        self._pending.append(_summed(keys, np.column_stack([in_map, colors, np.ones(len(keys))])))
        self._waiting += len(self._pending[-1][0])
        if self._waiting > _PENDING:
            self._merge()

    def result(self) -> tuple[Array, NDArray[np.uint8]]:
        """Return the points (n x 3, m, map) and their colours (n x 3)."""
        self._merge()
        count = self._sums[:, 6:]
        return self._sums[:, :3] / count, np.rint(self._sums[:, 3:6] / count).astype(np.uint8)

    def _merge(self) -> None:
        keys = np.concatenate([self._keys, *(keys for keys, _ in self._pending)])
        sums = np.concatenate([self._sums, *(sums for _, sums in self._pending)])
        self._keys, self._sums = _summed(keys, sums)
        self._pending, self._waiting = [], 0

    @staticmethod
    def _in_range(cubes: NDArray[np.int64]) -> Mask:
        return np.asarray(((cubes >= 0) & (cubes < 1 << _AXIS_BITS)).all(axis=1))


def _summed(keys: NDArray[np.int64], values: Array) -> tuple[NDArray[np.int64], Array]:
    """Return the different keys in order, and the sums of the rows of each."""
    order = np.argsort(keys, kind="stable")
    unique, first = np.unique(keys[order], return_index=True)
    return unique, np.add.reduceat(values[order], first, axis=0) if len(unique) else values[:0]
