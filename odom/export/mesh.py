"""A mesh of the surfaces that the key frames saw: truncated signed distances, by Open3D's voxel blocks.

Source: B. Curless, M. Levoy, "A volumetric method for building complex models from range images", SIGGRAPH 1996.
"""

from collections.abc import Callable, Iterable
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from odom.errors import ConfigError, InputError
from odom.export.triangles import TriangleMesh
from odom.frame import Camera
from odom.geometry import se3
from odom.geometry.arrays import Array, Image

_SIDE = 8
"""Voxels of a block along each edge. Larger: more of them lie far from any surface; smaller: more blocks to look up."""
_BYTES = _SIDE**3 * (12 + 16 + 4)
"""Of a block: distance, weight and colour, the vertices' numbers while the mesh is made, and the mesh itself."""
_TRUNCATION = 4.0
"""Voxels in front of and behind a surface that a depth changes. Smaller: noise tears the surface; larger: thin things
with two sides lose one of them."""
_LEAST_WEIGHT = 2.0
"""Key frames that must have seen a place: one alone leaves splinters at the edges of its image."""
_FIRST_BLOCKS = 2_000
"""Room of the grid that only looks which blocks there are; it grows by itself."""

Shot = tuple[NDArray[np.uint16], Image, Array]
"""Depth (H x W, mm), colour (H x W x 3) and T_map_camera of a pinhole image."""


def open3d() -> Any:
    """Return the package; raises ConfigError with the command that installs it where it is missing."""
    try:
        return import_module("open3d")
    except ImportError as error:
        raise ConfigError("--to mesh needs the package open3d: pip install 'rgbd-odom[dense]'") from error


class Volume:
    """Voxels of `voxel_m` around surfaces up to `farthest_m` away from a pinhole `camera`."""

    def __init__(self, camera: Camera, voxel_m: float, farthest_m: float) -> None:
        self._o3d = open3d()
        self._farthest_m, self._voxel_m = farthest_m, voxel_m
        self._intrinsic = self._o3d.core.Tensor(camera.matrix)
        self._blocks: NDArray[np.int64] = np.zeros((0, 3), dtype=np.int64)
        self._probe = self._grid(_FIRST_BLOCKS)

    def look(self, depth_mm: NDArray[np.uint16], T_map_camera: Array) -> None:
        """Note the blocks that a depth image would change."""
        if not depth_mm.any():  # Open3D takes that for a mistake
            return
        touched = self._touched(self._probe, self._image(depth_mm), T_map_camera).numpy()
        self._blocks = np.unique(np.concatenate([self._blocks, touched.astype(np.int64)]), axis=0)

    @property
    def blocks(self) -> int:
        """How many blocks the depth images seen by `look` need."""
        return len(self._blocks)

    @property
    def memory_mb(self) -> float:
        """The memory that these take, about, when the mesh is made."""
        return self.blocks * _BYTES / 2**20

    def mesh(self, shots: Iterable[Shot], progress: Callable[[int], None] = lambda done: None) -> TriangleMesh:
        """Return the mesh of the shots (map frame), whose depth images `look` has seen before.

        Raises InputError when there is no surface in them.
        """
        grid = self._grid(max(self.blocks, 1))
        for number, (depth_mm, color, T_map_camera) in enumerate(shots, 1):
            if not depth_mm.any():
                continue
            depth, image = self._image(depth_mm), self._image(np.ascontiguousarray(color))
            touched = self._touched(grid, depth, T_map_camera)
            extrinsic = self._o3d.core.Tensor(se3.inverse(T_map_camera))
            grid.integrate(
                touched,
                depth,
                image,
                self._intrinsic,
                self._intrinsic,
                extrinsic,
                1000.0,
                self._farthest_m,
                _TRUNCATION,
            )
            progress(number)
        made = grid.extract_triangle_mesh(weight_threshold=_LEAST_WEIGHT)
        if made.is_empty() or not len(made.triangle.indices):
            raise InputError("no surface was seen by two key frames: give more --farthest, or a longer recording")
        return TriangleMesh(
            made.vertex.positions.numpy().astype(np.float64),
            np.rint(255.0 * made.vertex.colors.numpy()).clip(0, 255).astype(np.uint8),
            made.triangle.indices.numpy().astype(np.uint32),
        )

    def _touched(self, grid: Any, depth: Any, T_map_camera: Array) -> Any:
        extrinsic = self._o3d.core.Tensor(se3.inverse(T_map_camera))
        return grid.compute_unique_block_coordinates(
            depth, self._intrinsic, extrinsic, 1000.0, self._farthest_m, _TRUNCATION
        )

    def _grid(self, blocks: int) -> Any:
        core = self._o3d.core
        return self._o3d.t.geometry.VoxelBlockGrid(
            attr_names=("tsdf", "weight", "color"),
            attr_dtypes=(core.float32, core.uint16, core.uint16),
            attr_channels=((1), (1), (3)),
            voxel_size=self._voxel_m,
            block_resolution=_SIDE,
            block_count=blocks,
        )

    def _image(self, array: NDArray[Any]) -> Any:
        return self._o3d.t.geometry.Image(self._o3d.core.Tensor(array))


def check_memory(volume: Volume, most_mb: float) -> None:
    """Raise ConfigError when the mesh would take more memory than that."""
    if volume.memory_mb > most_mb:
        raise ConfigError(
            f"the mesh would take some {volume.memory_mb:.0f} MB, more than {most_mb:.0f}: "
            "give larger voxels (--voxel), less depth (--farthest) or more --memory"
        )
