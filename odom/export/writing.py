"""Exports as files in a folder: the part that reads a recording's images and writes."""

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.errors import OdomError, writing_whole
from odom.evaluation.files import write_tum
from odom.evaluation.trajectory import Trajectory
from odom.export import colmap, mesh, nerfstudio, poses
from odom.export.cloud import VoxelCloud, cloud_of
from odom.export.rectify import pinhole_of
from odom.export.surface import surface_depth
from odom.export.triangles import TriangleMesh, glb, mesh_ply
from odom.export.views import Progress, Survey, View, views
from odom.frame import Camera
from odom.geometry.arrays import Array
from odom.rgbd_recording import RgbdRecording

_JPEG_QUALITY = 95
"""Of exported images: what is lost is less than the sensor's noise."""


@dataclass(frozen=True)
class ExportOptions:
    """How images and surfaces are made.

    `neighbours`: frames on each side of a key frame of which the sharpest stands for it; `unroll`: undo the rolling
    shutter; `voxel_m`: side of a cube of `ply` and `mesh`, from depth up to `farthest_m`; `memory_mb`: the most that a
    mesh may take.
    """

    neighbours: int = 2
    unroll: bool = True
    voxel_m: float = 0.01
    farthest_m: float = 4.0
    memory_mb: float = 1500.0


def write_trajectory(folder: Path, form: str, trajectory: Trajectory) -> None:
    """Write a trajectory in the form `tum`, `kitti` or `euroc`; raises OdomError for a file that cannot be written."""
    if form == "tum":
        with writing_whole(folder / "trajectory.txt") as part:
            write_tum(part, trajectory)
    elif form == "kitti":
        for name, text in zip(("poses.txt", "times.txt"), poses.kitti(trajectory), strict=True):
            _write(folder / name, text)
    else:
        _write(folder / "data.csv", poses.euroc(trajectory))


def _write(path: Path, content: str | bytes) -> None:
    with writing_whole(path) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)


@dataclass(frozen=True, eq=False)
class Exporter:
    """Writes what was surveyed of a `recording` into a `folder`; one method a format.

    `done` is told how many key frames are done, `say` how large a mesh will be. `is_stopped` is asked between two key
    frames: once it says so, those before make the result. A file that cannot be written raises OdomError.
    """

    folder: Path
    survey: Survey
    recording: RgbdRecording
    options: ExportOptions
    done: Progress = lambda keyframes: None
    say: Callable[[str], None] = lambda words: None
    is_stopped: Callable[[], bool] = lambda: False

    def write_g2o(self) -> None:
        """Write the pose graph of the key frames to graph.g2o."""
        _write(self.folder / "graph.g2o", poses.g2o(self.survey.scene))

    def write_colmap(self) -> None:
        """Write images/, depth/, the model in sparse/0 (binary) and sparse/text, and covariances.json."""
        model = self._model(self._sightings())
        for name, content in colmap.binary_files(model).items():
            _write(self.folder / "sparse" / "0" / name, content)
        for name, words in colmap.text_files(model).items():
            _write(self.folder / "sparse" / "text" / name, words)

    def write_nerfstudio(self) -> None:
        """Write images/, depth/, transforms.json, points.ply (the landmarks, with colours) and covariances.json."""
        sightings = self._sightings()
        model = self._model(sightings)
        self._write_points(model.points, model.colors)
        images = [(Path(one.name).stem, one.T_map_camera) for one in sightings]
        content = nerfstudio.transforms(self._pinhole, images)
        _write(self.folder / "transforms.json", json.dumps(content, indent=1) + "\n")

    def write_ply(self) -> None:
        """Write the points of all key frames, fused, to points.ply."""
        cloud = VoxelCloud(self.options.voxel_m)
        for number, (depth_mm, color, T_map_camera) in enumerate(self._shots(), 1):
            cloud.add(T_map_camera, *cloud_of(self._pinhole, depth_mm, color))
            self.done(number)
        self._write_points(*cloud.result())

    def write_mesh(self) -> None:
        """Write mesh.ply and mesh.glb.

        Raises ConfigError when that would take too much memory, OdomError when it was stopped before it had begun.
        """
        volume = mesh.Volume(self._pinhole, self.options.voxel_m, self.options.farthest_m)
        for depth_mm, _, T_map_camera in self._shots():
            volume.look(depth_mm, T_map_camera)
        if self.is_stopped():
            raise OdomError("stopped before there was a mesh")
        self.say(f"{volume.blocks} blocks of voxels, some {volume.memory_mb:.0f} MB")
        mesh.check_memory(volume, self.options.memory_mb)
        made = volume.mesh(self._shots(), self.done)
        _write(self.folder / "mesh.ply", mesh_ply(made))
        _write(self.folder / "mesh.glb", glb(made))

    @cached_property
    def _pinhole(self) -> Camera:
        return pinhole_of(self.survey.camera)

    def _sightings(self) -> list[colmap.Sighting]:
        """Write the key frames' images, depths and covariances; return what each shows of the landmarks."""
        seen = self._views(self.options.neighbours, self.options.unroll)
        return [colmap.Sighting.of(view) for view in self._written(seen)]

    def _model(self, sightings: list[colmap.Sighting]) -> colmap.ColmapModel:
        return colmap.model_of(self._pinhole, sightings, self.survey.scene.points)

    def _write_points(self, points: Array, colors: NDArray[np.uint8]) -> None:
        cloud = TriangleMesh(points, colors, np.zeros((0, 3), dtype=np.uint32))
        _write(self.folder / "points.ply", mesh_ply(cloud))

    def _shots(self) -> Iterator[mesh.Shot]:
        """Yield each key frame as its depth image saw it."""
        for view in self._views():
            yield surface_depth(view.depth_mm, self.options.farthest_m), view.color, view.T_map_depth

    def _views(self, neighbours: int = 0, unroll: bool = False) -> Iterator[View]:
        """Yield the views of the key frames, of one at least, until it is stopped."""
        for number, view in enumerate(views(self.survey, self.recording, neighbours, unroll)):
            if number and self.is_stopped():
                return
            yield view

    def _written(self, seen: Iterable[View]) -> Iterator[View]:
        """Write the views' images, depths and covariances, and hand them on."""
        covariances = {}
        for number, view in enumerate(seen, 1):
            jpeg = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
            bgr = cv2.cvtColor(view.color, cv2.COLOR_RGB2BGR)
            for path, image in ((f"images/{view.name}.jpg", bgr), (f"depth/{view.name}.png", view.depth_mm)):
                _, file = cv2.imencode(path[-4:], image, jpeg if path.endswith("jpg") else [])
                _write(self.folder / path, file.tobytes())
            covariances[view.name] = view.covariance.tolist()
            self.done(number)
            yield view
        about = "6 x 6 of (translation m, rotation rad) in T_map_camera = T @ exp(xi), since the map's first key frame"
        content = {"about": about, "covariances": covariances}
        _write(self.folder / "covariances.json", json.dumps(content) + "\n")
