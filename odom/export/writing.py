"""Exports as files in a folder: the part that reads a recording's images and writes."""

import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.evaluation.files import write_tum
from odom.evaluation.trajectory import Trajectory
from odom.export import colmap, mesh, nerfstudio, poses
from odom.export.cloud import VoxelCloud, cloud_of
from odom.export.rectify import pinhole_of
from odom.export.surface import surface_depth
from odom.export.triangles import TriangleMesh, glb, mesh_ply
from odom.export.views import Progress, Survey, View, views
from odom.geometry.arrays import Array, Image
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
    """Write a trajectory in the form `tum`, `kitti` or `euroc`; raises OSError when the folder cannot be written."""
    if form == "tum":
        write_tum(folder / "trajectory.txt", trajectory)
    elif form == "kitti":
        for name, text in zip(("poses.txt", "times.txt"), poses.kitti(trajectory), strict=True):
            (folder / name).write_text(text)
    else:
        (folder / "data.csv").write_text(poses.euroc(trajectory))


def write_g2o(folder: Path, survey: Survey, recording: RgbdRecording, options: ExportOptions, done: Progress) -> None:
    """Write the pose graph of the key frames to graph.g2o."""
    (folder / "graph.g2o").write_text(poses.g2o(survey.scene))


def write_colmap(
    folder: Path, survey: Survey, recording: RgbdRecording, options: ExportOptions, done: Progress
) -> None:
    """Write images/, depth/, the model in sparse/0 (binary) and sparse/text, and covariances.json."""
    model = _model(_sightings(folder, survey, recording, options, done), survey, recording)
    binary, text = folder / "sparse" / "0", folder / "sparse" / "text"
    for place in (binary, text):
        place.mkdir(parents=True)
    for name, content in colmap.binary_files(model).items():
        (binary / name).write_bytes(content)
    for name, words in colmap.text_files(model).items():
        (text / name).write_text(words)


def write_nerfstudio(
    folder: Path, survey: Survey, recording: RgbdRecording, options: ExportOptions, done: Progress
) -> None:
    """Write images/, depth/, transforms.json, points.ply (the landmarks, with colours) and covariances.json."""
    sightings = _sightings(folder, survey, recording, options, done)
    model = _model(sightings, survey, recording)
    _write_points(folder, model.points, model.colors)
    images = [(Path(one.name).stem, one.T_map_camera) for one in sightings]
    (folder / "transforms.json").write_text(
        json.dumps(nerfstudio.transforms(pinhole_of(recording.camera), images), indent=1) + "\n"
    )


def write_ply(folder: Path, survey: Survey, recording: RgbdRecording, options: ExportOptions, done: Progress) -> None:
    """Write the points of all key frames, fused, to points.ply."""
    camera, cloud = pinhole_of(recording.camera), VoxelCloud(options.voxel_m)
    for number, (depth_mm, color, T_map_camera) in enumerate(_shots(survey, recording, options), 1):
        cloud.add(T_map_camera, *cloud_of(camera, depth_mm, color))
        done(number)
    _write_points(folder, *cloud.result())


def write_mesh(
    folder: Path,
    survey: Survey,
    recording: RgbdRecording,
    options: ExportOptions,
    done: Progress,
    say: Callable[[str], None],
) -> None:
    """Write mesh.ply and mesh.glb, after saying how much memory they take; raises ConfigError when that is too much."""
    volume = mesh.Volume(pinhole_of(recording.camera), options.voxel_m, options.farthest_m)
    for depth_mm, _, T_map_camera in _shots(survey, recording, options):
        volume.look(depth_mm, T_map_camera)
    say(f"{volume.blocks} blocks of voxels, some {volume.memory_mb:.0f} MB")
    mesh.check_memory(volume, options.memory_mb)
    made = volume.mesh(_shots(survey, recording, options), done)
    (folder / "mesh.ply").write_bytes(mesh_ply(made))
    (folder / "mesh.glb").write_bytes(glb(made))


def _sightings(
    folder: Path, survey: Survey, recording: RgbdRecording, options: ExportOptions, done: Progress
) -> list[colmap.Sighting]:
    """Write the key frames' images, depths and covariances; return what each shows of the landmarks."""
    seen = views(survey, recording, options.neighbours, options.unroll)
    return [colmap.Sighting.of(view) for view in _written(folder, seen, done)]


def _model(sightings: list[colmap.Sighting], survey: Survey, recording: RgbdRecording) -> colmap.ColmapModel:
    return colmap.model_of(pinhole_of(recording.camera), sightings, survey.scene.points)


def _write_points(folder: Path, points: Array, colors: NDArray[np.uint8]) -> None:
    cloud = TriangleMesh(points, colors, np.zeros((0, 3), dtype=np.uint32))
    (folder / "points.ply").write_bytes(mesh_ply(cloud))


def _shots(
    survey: Survey, recording: RgbdRecording, options: ExportOptions
) -> Iterator[tuple[NDArray[np.uint16], Image, Array]]:
    """Yield depth (mm), colour and T_map_camera of each key frame as its depth image saw it."""
    for view in views(survey, recording):
        yield surface_depth(view.depth_mm, options.farthest_m), view.color, view.T_map_depth


def _written(folder: Path, seen: Iterable[View], done: Progress) -> Iterator[View]:
    """Write the views' images, depths and covariances, and hand them on."""
    for name in ("images", "depth"):
        (folder / name).mkdir()
    covariances = {}
    for number, view in enumerate(seen, 1):
        jpeg = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
        bgr = cv2.cvtColor(view.color, cv2.COLOR_RGB2BGR)
        for path, image in ((f"images/{view.name}.jpg", bgr), (f"depth/{view.name}.png", view.depth_mm)):
            if not cv2.imwrite(str(folder / path), image, jpeg if path.endswith("jpg") else []):
                raise OSError(f"{folder / path} cannot be written")
        covariances[view.name] = view.covariance.tolist()
        done(number)
        yield view
    about = "6 x 6 of (translation m, rotation rad) in T_map_camera = T @ exp(xi), since the map's first key frame"
    content = {"about": about, "covariances": covariances}
    (folder / "covariances.json").write_text(json.dumps(content) + "\n")
