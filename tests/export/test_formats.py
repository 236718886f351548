"""Each format is opened by a reader of its own."""

import json

import cv2
import gtsam
import numpy as np
import pytest
from evo.tools import file_interface
from full_disk import room_for
from painted_room import SMALL
from room_survey import ROOM, RoomRecording, exact_survey, seen

from odom.errors import OdomError
from odom.evaluation.files import read_kitti
from odom.export import writing
from odom.export.writing import Exporter, ExportOptions, write_trajectory
from odom.geometry import se3

OPTIONS = ExportOptions(neighbours=0, voxel_m=0.02)


@pytest.fixture(scope="module")
def survey():
    return exact_survey()


def written(tmp_path, write, survey, options=OPTIONS):
    folder = tmp_path / "out"
    folder.mkdir()
    write(Exporter(folder, survey, RoomRecording(), options))
    return folder


@pytest.mark.parametrize(
    ("write", "file"),
    [
        (Exporter.write_colmap, "images/.*jpg"),
        (Exporter.write_ply, "points.ply"),
        (Exporter.write_g2o, "graph.g2o"),
        (lambda exporter: write_trajectory(exporter.folder, "tum", exporter.survey.scene.trajectory), "trajectory.txt"),
        (lambda exporter: write_trajectory(exporter.folder, "kitti", exporter.survey.scene.trajectory), "poses.txt"),
    ],
)
def test_on_a_full_disk_the_file_is_named_with_what_to_do_and_no_torn_one_is_left(
    tmp_path, survey, write, file, monkeypatch
):
    monkeypatch.setattr("drawn._has_room", lambda folder: False)
    full = pytest.raises(OdomError, match=f"{tmp_path}/out/{file} cannot be written: .*make room")
    with room_for(1000), full:
        written(tmp_path, write, survey)
    assert not [path for path in (tmp_path / "out").rglob("*") if path.is_file() and path.stat().st_size == 1000]
    assert not list((tmp_path / "out").rglob("*.part"))


def test_evo_reads_the_trajectories(tmp_path, survey):
    trajectory = survey.scene.trajectory
    for form in ("tum", "euroc", "kitti"):
        writing.write_trajectory(tmp_path, form, trajectory)
    tum = file_interface.read_tum_trajectory_file(tmp_path / "trajectory.txt")
    euroc = file_interface.read_euroc_csv_trajectory(tmp_path / "data.csv")
    kitti = file_interface.read_kitti_poses_file(tmp_path / "poses.txt")
    for read in (tum, euroc):
        assert np.allclose(read.poses_se3, trajectory.T_world_body, atol=1e-7)
        assert np.allclose(read.timestamps, trajectory.stamps * 1e-9, atol=1e-6)
    assert np.allclose(kitti.poses_se3, se3.inverse(trajectory.T_world_body[0]) @ trajectory.T_world_body, atol=1e-7)
    again = read_kitti(tmp_path / "poses.txt", tmp_path / "times.txt")
    assert np.abs(np.diff(again.stamps) - np.diff(trajectory.stamps)).max() <= 1


@pytest.mark.parametrize("form", ["tum", "euroc", "kitti"])
def test_a_trajectory_without_poses_is_a_file_without_poses(tmp_path, survey, form):
    writing.write_trajectory(tmp_path, form, survey.scene.trajectory.take(np.zeros(61, dtype=bool)))
    assert all(line.startswith("#") for file in tmp_path.iterdir() for line in file.read_text().splitlines())


def test_gtsam_reads_the_graph(tmp_path, survey):
    graph, values = gtsam.readG2o(str(written(tmp_path, Exporter.write_g2o, survey) / "graph.g2o"), True)
    scene = survey.scene
    for number, keyframe in enumerate(scene.keyframes):
        assert np.allclose(values.atPose3(number).matrix(), keyframe.T_map_camera, atol=1e-7)
    edges = [graph.at(i) for i in range(graph.size()) if isinstance(graph.at(i), gtsam.BetweenFactorPose3)]
    assert len(edges) == len(scene.edges)
    swap = np.r_[3:6, 0:3]  # gtsam's tangent has the rotation first
    for factor, edge in zip(edges, scene.edges, strict=True):
        assert np.allclose(factor.measured().matrix(), edge.T_a_b, atol=1e-7)
        assert np.allclose(factor.noiseModel().covariance(), edge.covariance[np.ix_(swap, swap)], rtol=1e-6)


@pytest.mark.parametrize("model", ["0", "text"])
def test_colmap_reads_the_model(tmp_path, survey, model):
    pycolmap = pytest.importorskip("pycolmap", reason="pip install pycolmap")
    folder = written(tmp_path, Exporter.write_colmap, survey)
    read = pycolmap.Reconstruction(folder / "sparse" / model)
    scene = survey.scene
    assert read.num_images() == len(scene.keyframes) == len(list((folder / "images").iterdir()))
    assert read.num_points3D() > 100
    read.update_point_3d_errors()
    assert read.compute_mean_reprojection_error() < 1e-3  # poses, points and pixels of the room are exact
    for number, keyframe in enumerate(scene.keyframes, 1):
        image = read.image(number)
        assert image.name == f"{keyframe.stamp}.jpg"
        cam_from_world = np.vstack([image.cam_from_world().matrix(), [0, 0, 0, 1]])
        assert np.allclose(cam_from_world, se3.inverse(keyframe.T_map_camera), atol=1e-7)
    points = np.array([point.xyz for point in read.points3D.values()])
    assert np.abs(points[:, None] - scene.points).sum(axis=2).min(axis=1).max() < 1e-6
    assert all(point.track.length() >= 2 for point in read.points3D.values())
    assert np.allclose(read.camera(1).params, [SMALL.fx, SMALL.fy, SMALL.cx + 0.5, SMALL.cy + 0.5])


def test_observations_that_do_not_fit_are_in_no_track(tmp_path, survey):
    from odom.export.colmap import Sighting, model_of

    points = np.array([[0.0, 0.0, 2.0], [0.3, 0.0, 2.0]])
    rows, uv = seen(points, np.eye(4))
    sound = Sighting("a", np.eye(4), rows, uv, np.zeros((2, 3), np.uint8))
    wrong = Sighting("b", np.eye(4), rows, uv + np.array([[0, 0], [9, 0]]), np.zeros((2, 3), np.uint8))
    model = model_of(SMALL, [sound, wrong], points)
    assert model.tracks() == [[(1, 0), (2, 0)]]
    assert model.images[0].point_ids.tolist() == [1, -1]
    assert np.allclose(model.points, points[:1])


def test_a_pixel_of_one_nerfstudio_image_is_found_in_another_by_depth_and_poses(tmp_path, survey):
    folder = written(tmp_path, Exporter.write_nerfstudio, survey)
    content = json.loads((folder / "transforms.json").read_text())
    assert {content[name] for name in ("k1", "k2", "p1", "p2", "k3")} == {0.0}
    one, other = (content["frames"][k] for k in (1, 3))
    depth = cv2.imread(str(folder / one["depth_file_path"]), cv2.IMREAD_UNCHANGED)
    colors = [cv2.imread(str(folder / frame["file_path"])) for frame in (one, other)]
    v, u = np.mgrid[20:220:7, 20:300:7].reshape(2, -1)
    z = depth[v, u] * content["depth_unit_scale_factor"]
    x = (u + 0.5 - content["cx"]) / content["fl_x"]
    y = (v + 0.5 - content["cy"]) / content["fl_y"]
    points_gl = np.column_stack([x * z, -y * z, -z])
    T = [np.array(frame["transform_matrix"]) for frame in (one, other)]
    there = se3.apply(se3.inverse(T[1]) @ T[0], points_gl) * [1, -1, -1]
    uv = np.rint(there[:, :2] / there[:, 2:] * content["fl_x"] + [content["cx"], content["cy"]] - 0.5).astype(int)
    inside = ((uv >= 0) & (uv < [SMALL.width, SMALL.height])).all(axis=1)
    assert inside.sum() > 500
    apart = colors[1][uv[inside, 1], uv[inside, 0]].astype(int) - colors[0][v[inside], u[inside]]
    assert np.median(np.abs(apart)) < 8
    covariances = json.loads((folder / "covariances.json").read_text())["covariances"]
    assert {f"images/{name}.jpg" for name in covariances} == {frame["file_path"] for frame in content["frames"]}


def test_a_ply_reader_finds_the_walls_where_they_are(tmp_path, survey):
    plyfile = pytest.importorskip("plyfile", reason="pip install plyfile")
    vertices = plyfile.PlyData.read(written(tmp_path, Exporter.write_ply, survey) / "points.ply")["vertex"]
    points = np.column_stack([vertices[axis] for axis in "xyz"])
    assert len(points) > 10_000
    assert np.abs(np.abs(points) - ROOM.half_size).min(axis=1).max() < 0.01
    assert {vertices[name].dtype for name in ("red", "green", "blue")} == {np.dtype("u1")}
    cubes = np.floor(points.astype(np.float64) / OPTIONS.voxel_m + 1e-6).astype(int)
    assert len(np.unique(cubes, axis=0)) > 0.99 * len(points)


def test_the_mesh_lies_on_the_walls(tmp_path, survey):
    open3d = pytest.importorskip("open3d", reason="pip install 'rgbd-odom[dense]'")
    folder, said = tmp_path / "out", []
    folder.mkdir()
    options = ExportOptions(voxel_m=0.02, memory_mb=400)
    Exporter(folder, survey, RoomRecording(), options, say=said.append).write_mesh()
    assert "blocks of voxels" in said[0]
    for name in ("mesh.ply", "mesh.glb"):
        mesh = open3d.io.read_triangle_mesh(str(folder / name))
        vertices = np.asarray(mesh.vertices)
        assert len(vertices) > 5_000
        assert len(mesh.triangles) > 10_000
        assert mesh.has_vertex_colors()
        off = np.abs(np.abs(vertices) - ROOM.half_size).min(axis=1)  # the room is the same upside down
        assert np.quantile(off, 0.95) < 0.02


def test_a_mesh_that_is_too_large_is_refused_before_it_is_made(tmp_path, survey):
    pytest.importorskip("open3d", reason="pip install 'rgbd-odom[dense]'")
    from odom.errors import ConfigError

    options = ExportOptions(voxel_m=0.005, memory_mb=50)
    with pytest.raises(ConfigError, match="--voxel"):
        Exporter(tmp_path, survey, RoomRecording(), options).write_mesh()
    assert not list(tmp_path.iterdir())


def test_open3d_that_is_missing_is_named_with_the_command(monkeypatch):
    import sys

    from odom.errors import ConfigError
    from odom.export.mesh import open3d

    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(ConfigError, match=r"pip install 'rgbd-odom\[dense\]'"):
        open3d()


def after(count):
    """Says yes from the `count`-th question on."""
    asked = iter(range(1, 1000))
    return lambda: next(asked) >= count


def test_an_interrupted_export_holds_the_key_frames_until_then(tmp_path, survey):
    for name, write in (("colmap", Exporter.write_colmap), ("nerfstudio", Exporter.write_nerfstudio)):
        folder = tmp_path / name
        folder.mkdir()
        write(Exporter(folder, survey, RoomRecording(), OPTIONS, is_stopped=after(3)))
        images = {file.stem for file in (folder / "images").iterdir()}
        assert images == {str(keyframe.stamp) for keyframe in survey.scene.keyframes[:3]}
        assert json.loads((folder / "covariances.json").read_text())["covariances"].keys() == images
    done = []
    Exporter(tmp_path, survey, RoomRecording(), OPTIONS, done.append, is_stopped=after(2)).write_ply()
    assert done == [1, 2]
    assert (tmp_path / "points.ply").stat().st_size > 1000


def test_a_mesh_interrupted_before_it_is_begun_is_a_failure(tmp_path, survey):
    pytest.importorskip("open3d", reason="pip install 'rgbd-odom[dense]'")
    with pytest.raises(OdomError, match="stopped before"):
        Exporter(tmp_path, survey, RoomRecording(), OPTIONS, is_stopped=after(2)).write_mesh()
