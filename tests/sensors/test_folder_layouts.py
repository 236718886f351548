"""One walk in the layouts of several data sets gives the same images, poses and stamps."""

import json
import re
import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from odom.batch.recordings import find_recordings
from odom.errors import ConfigError, SourceError
from odom.frame import Camera
from odom.geometry.quaternion import quaternion_from_rotation
from odom.rgbd_recording import read_recording
from odom.wire import Topics, truth
from odom.wire.codec import decode_camera_info, decode_color, decode_depth, decode_pose
from sensors.calibration_file import Calibration, calibration_text
from sensors.catalogue import open_source
from sensors.default_camera import kinect_camera, tum_camera
from sensors.depth_registration import DepthRegistration, registration_text
from sensors.folder_camera import depth_images_of
from sensors.folder_layouts import layout_of
from sensors.image_names import by_stamp, images_in
from sensors.source import SourceOptions

TOPICS = Topics()
FRAMES = 4
SIZE = 64, 48
Write = Callable[[Path], Camera]


def color(i: int, size: tuple[int, int] = SIZE) -> np.ndarray:
    return np.full((*size[::-1], 3), (10 * i, 100, 200), dtype=np.uint8)


def depth(i: int, units: float, unknown: int = 0) -> np.ndarray:
    image = np.full(SIZE[::-1], round((1.5 + 0.1 * i) * units), dtype=np.uint16)
    image[0] = unknown
    return image


def pose(i: int) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(0.1 * i * np.array([0.6, 0.48, 0.64]))[0]
    T[:3, 3] = 0.1 * i, 0.2, 0.3
    return T


def as_seen_from_a_camera_whose_y_axis_points_up(T_world_camera: np.ndarray) -> np.ndarray:
    """The pose in ICL-NUIM's frames, which are left-handed: world and camera have the opposite y axis."""
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    return mirror @ T_world_camera @ mirror


def tum_line(stamp: float, T: np.ndarray) -> str:
    return " ".join(map(str, (stamp, *T[:3, 3].tolist(), *quaternion_from_rotation(T[:3, :3]).tolist())))


def beside(x: float) -> np.ndarray:
    T = np.eye(4)
    T[0, 3] = x
    return T


def seven_scenes(folder: Path) -> Camera:
    for i in range(FRAMES):
        cv2.imwrite(str(folder / f"frame-{i:06}.color.png"), color(i))
        cv2.imwrite(str(folder / f"frame-{i:06}.depth.png"), depth(i, 1000, 65535))
        np.savetxt(folder / f"frame-{i:06}.pose.txt", pose(i) @ beside(-0.025))
    return kinect_camera(*SIZE)


def scannet(folder: Path) -> Camera:
    for name in ("color", "depth", "pose", "intrinsic"):
        (folder / name).mkdir()
    for i in range(FRAMES):
        cv2.imwrite(str(folder / "color" / f"{i}.png"), color(i))
        cv2.imwrite(str(folder / "depth" / f"{i}.png"), depth(i, 1000))
        np.savetxt(folder / "pose" / f"{i}.txt", pose(i))
    for name in ("color", "depth"):
        np.savetxt(folder / "intrinsic" / f"intrinsic_{name}.txt", np.diag([60.0, 61.0, 1.0, 1.0]))
    return Camera(*SIZE, 60.0, 61.0, 0.0, 0.0)


def replica(folder: Path) -> Camera:
    (folder / "results").mkdir()
    for i in range(FRAMES):
        cv2.imwrite(str(folder / "results" / f"frame{i:06}.png"), color(i))
        cv2.imwrite(str(folder / "results" / f"depth{i:06}.png"), depth(i, 6553.5))
    np.savetxt(folder / "traj.txt", np.array([pose(i).ravel() for i in range(FRAMES)]))
    camera = {"w": 64, "h": 48, "fx": 60.0, "fy": 61.0, "cx": 31.5, "cy": 23.5, "scale": 6553.5}
    (folder.parent / "cam_params.json").write_text(json.dumps({"camera": camera}))
    return Camera(*SIZE, 60.0, 61.0, 31.5, 23.5)


def icl_nuim(folder: Path) -> Camera:
    (folder / "rgb").mkdir()
    (folder / "depth").mkdir()
    pairs, poses = [], []
    for i in range(FRAMES):
        cv2.imwrite(str(folder / "rgb" / f"{i}.png"), color(i))
        cv2.imwrite(str(folder / "depth" / f"{i}.png"), depth(i, 5000))
        pairs.append(f"{i} depth/{i}.png {i} rgb/{i}.png")
        poses.append(tum_line(i, as_seen_from_a_camera_whose_y_axis_points_up(pose(i))))
    (folder / "associations.txt").write_text("\n".join(pairs))
    (folder / "livingRoom0.gt.freiburg").write_text("\n".join(poses))
    (folder / "camera.yaml").write_text(
        "image_width: 64\nimage_height: 48\ncamera_matrix: {data: [60, 0, 31.5, 0, 61, 23.5, 0, 0, 1]}\n"
    )
    return Camera(*SIZE, 60.0, 61.0, 31.5, 23.5)


def others_with_associations(folder: Path) -> Camera:
    """ICL-NUIM's lists with true poses as everyone else writes them."""
    camera = icl_nuim(folder)
    (folder / "livingRoom0.gt.freiburg").unlink()
    (folder / "groundtruth.txt").write_text("\n".join(tum_line(i, pose(i)) for i in range(FRAMES)))
    return camera


def eth3d(folder: Path) -> Camera:
    (folder / "rgb").mkdir()
    (folder / "depth").mkdir()
    for name, images in (("rgb", color), ("depth", lambda i: depth(i, 5000))):
        for i in range(FRAMES):
            cv2.imwrite(str(folder / name / f"{i}.png"), images(i))
        (folder / f"{name}.txt").write_text("\n".join(f"{i / 30:.9f} {name}/{i}.png" for i in range(FRAMES)))
    (folder / "groundtruth.txt").write_text("\n".join(tum_line(i / 30, pose(i)) for i in range(FRAMES)))
    (folder / "calibration.txt").write_text("60 61 31.5 23.5\n")
    return Camera(*SIZE, 60.0, 61.0, 31.5, 23.5)


LAYOUTS = (seven_scenes, scannet, replica, icl_nuim, others_with_associations, eth3d)


@pytest.mark.parametrize("write", LAYOUTS)
def test_images_poses_and_stamps_are_those_of_the_walk(tmp_path: Path, write: Write) -> None:
    folder = tmp_path / "walk"
    folder.mkdir()
    camera = write(folder)
    messages = list(open_source(str(folder), SourceOptions(topics=TOPICS)).messages())
    info, *rest = messages
    assert decode_camera_info(info) == camera
    counts = Counter(message.topic for message in rest)
    assert counts == {TOPICS.color_compressed: FRAMES, TOPICS.depth: FRAMES, truth("camera"): FRAMES}
    of = {topic: [message for message in rest if message.topic == topic] for topic in counts}
    for i in range(FRAMES):
        assert {of[topic][i].stamp for topic in counts} == {round(i * 1e9 / 30)}
        assert np.array_equal(decode_color(of[TOPICS.color_compressed][i]), color(i)[..., ::-1])
        mm = decode_depth(of[TOPICS.depth][i])
        assert (mm[0] == 0).all()
        seen = np.s_[6:-6, 6:-6] if write is seven_scenes else np.s_[1:]  # raw depth does not fill colour's view
        assert (mm[seen] == 1500 + 100 * i).all()
        assert np.allclose(decode_pose(of[truth("camera")][i]).T_parent_child, pose(i), atol=1e-9)


@pytest.mark.parametrize("write", LAYOUTS)
def test_every_layout_is_read_from_python_and_found_by_a_batch(tmp_path: Path, write: Write) -> None:
    folder = tmp_path / "all" / "walk"
    folder.mkdir(parents=True)
    write(folder)
    recording = read_recording(folder)
    assert np.allclose(recording.truth()["camera"].T_world_body[2], pose(2), atol=1e-9)
    assert [found.path for found in find_recordings([tmp_path / "all"])] == [folder.resolve()]


def open3d(folder: Path) -> tuple[Camera, list[int]]:
    images(folder, "color/{0:06}.jpg", "depth/{0:06}.png", lambda mm: mm)
    matrix = [60, 0, 0, 0, 61, 0, 31.5, 23.5, 1]
    (folder / "intrinsic.json").write_text(json.dumps({"width": 64, "height": 48, "intrinsic_matrix": matrix}))
    return Camera(*SIZE, 60.0, 61.0, 31.5, 23.5), [round(i * 1e9 / 30) for i in range(FRAMES)]


def sun3d(folder: Path) -> tuple[Camera, list[int]]:
    images(folder, "image/{0:07}-{1:012}.jpg", "depth/{0:07}-{1:012}.png", lambda mm: mm << 3 | mm >> 13)
    np.savetxt(folder / "intrinsics.txt", [[60, 0, 31.5], [0, 61, 23.5], [0, 0, 1]])
    return Camera(*SIZE, 60.0, 61.0, 31.5, 23.5), [i * 33_367_000 for i in range(FRAMES)]


def named_by_seconds(folder: Path) -> tuple[Camera, list[int]]:
    images(folder, "rgb/17{0:08}.033367.png", "depth/17{0:08}.033367.png", lambda mm: mm)
    return kinect_camera(*SIZE), [(1_700_000_000 + i) * 10**9 + 33_367_000 for i in range(FRAMES)]


def named_by_milliseconds(folder: Path) -> tuple[Camera, list[int]]:
    images(folder, "rgb/17{0:08}033.PNG", "depth/17{0:08}033.png", lambda mm: mm)
    return kinect_camera(*SIZE), [(1_700_000_000 + i) * 10**9 + 33_000_000 for i in range(FRAMES)]


def images(folder: Path, color_name: str, depth_name: str, stored: Callable[[np.ndarray], np.ndarray]) -> None:
    for i in range(FRAMES):
        for name, image in ((color_name, color(i)), (depth_name, stored(depth(i, 1000) + np.uint16(i % 2)))):
            file = folder / name.format(i, i * 33_367)
            file.parent.mkdir(exist_ok=True)
            cv2.imwrite(str(file), image)


@pytest.mark.parametrize("write", [open3d, sun3d, named_by_seconds, named_by_milliseconds])
def test_colour_and_depth_in_folders_of_their_own_need_no_list(
    tmp_path: Path, write: Callable[[Path], tuple[Camera, list[int]]]
) -> None:
    folder = tmp_path / "all" / "walk"
    folder.mkdir(parents=True)
    camera, stamps = write(folder)
    (folder / "depth" / "notes.txt").write_text("12 images")
    info, *rest = open_source(str(folder), SourceOptions(topics=TOPICS)).messages()
    assert decode_camera_info(info) == camera
    seen = [message for message in rest if message.topic == TOPICS.depth]
    assert [message.stamp for message in rest if message.topic == TOPICS.color_compressed] == stamps
    assert [message.stamp for message in seen] == stamps
    for i, message in enumerate(seen):
        mm = decode_depth(message)
        assert (mm[0] == i % 2).all()
        assert (mm[1:] == 1500 + 100 * i + i % 2).all()
    assert [found.path for found in find_recordings([tmp_path / "all"])] == [folder.resolve()]


def renamed(folder: Path, name_of: Callable[[int], str], suffix: str) -> None:
    """Give images and poses of a ScanNet-like folder other names, the images another suffix."""
    for directory in ("color", "depth", "pose"):
        for file in (folder / directory).iterdir():
            new = name_of(int(file.stem)) + (".txt" if directory == "pose" else suffix)
            file.rename(file.with_name(new))


@pytest.mark.parametrize("suffix", [".PNG", ".png"])
@pytest.mark.parametrize("with_poses", [True, False])
def test_files_of_scannets_layout_may_be_named_by_stamps(tmp_path: Path, suffix: str, with_poses: bool) -> None:
    camera = scannet(tmp_path)
    renamed(tmp_path, lambda i: f"1311868163.{869 - 33 * i}", suffix)
    stamps = [1_311_868_163_000_000_000 + (869 - 33 * i) * 1_000_000 for i in reversed(range(FRAMES))]
    if not with_poses:
        shutil.rmtree(tmp_path / "pose")
    found = layout_of(tmp_path)
    for entries in (found.color, found.depth, *([found.truth] if with_poses else [])):
        assert [entry.stamp for entry in entries] == stamps
    assert found.camera == camera
    assert len(found.truth) == (FRAMES if with_poses else 0)


@pytest.mark.parametrize("suffix", [".JPG", ".jpeg", ".JPEG"])
def test_colour_may_have_any_spelling_of_its_suffix(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "a").mkdir()
    scannet(tmp_path / "a")
    (tmp_path / "b").mkdir()
    replica(tmp_path / "b")
    for folder, pattern in ((tmp_path / "a" / "color", "*"), (tmp_path / "b" / "results", "frame*")):
        for file in list(folder.glob(pattern)):
            file.with_suffix(suffix).write_bytes(cv2.imencode(".jpg", cv2.imread(str(file)))[1].tobytes())
            file.unlink()
    for folder in (tmp_path / "a", tmp_path / "b"):
        messages = list(open_source(str(folder), SourceOptions(topics=TOPICS)).messages())
        assert sum(message.topic == TOPICS.color_compressed for message in messages) == FRAMES


def test_intrinsics_beside_the_images_that_are_none_are_told(tmp_path: Path) -> None:
    open3d(tmp_path)
    (tmp_path / "intrinsic.json").write_text('{"width": 64}')
    with pytest.raises(ConfigError, match=r"intrinsic.json: give Open3D's width"):
        open_source(str(tmp_path), SourceOptions())


def write_poses(folder: Path, file: str, count: int) -> None:
    """As Open3D writes them, each below its frames; or as SUN3D does, three rows a pose."""
    is_log, lines = file.endswith(".log"), list[str]()
    for i in range(count):
        lines += [f"{i} {i} {i + 1}"] if is_log else []
        lines += [" ".join(map(str, row)) for row in pose(i)[: 4 if is_log else 3].tolist()]
    (folder / file).parent.mkdir(exist_ok=True)
    (folder / file).write_text("\n".join(lines))


@pytest.mark.parametrize("write", [open3d, sun3d])
@pytest.mark.parametrize("file", ["trajectory.log", "extrinsics/20140807.txt"])
def test_true_poses_in_the_order_of_the_images_are_read(
    tmp_path: Path, write: Callable[[Path], tuple[Camera, list[int]]], file: str
) -> None:
    _, stamps = write(tmp_path)
    write_poses(tmp_path, file, FRAMES)
    poses = read_recording(tmp_path).truth()["camera"]
    assert poses.stamps.tolist() == stamps
    assert np.allclose(poses.T_world_body, [pose(i) for i in range(FRAMES)], atol=1e-9)


@pytest.mark.parametrize("file", ["trajectory.log", "extrinsics/20140807.txt"])
def test_true_poses_of_another_number_than_the_images_are_told_and_left_aside(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, file: str
) -> None:
    open3d(tmp_path)
    write_poses(tmp_path, file, FRAMES + 1)
    assert layout_of(tmp_path).truth == []
    assert f"it does not hold a pose for each of the {FRAMES} colour images" in caplog.text


@pytest.mark.parametrize("first", [0, 1600])
@pytest.mark.parametrize("write", [open3d, sun3d])
def test_rotated_depth_is_known_whatever_the_first_image_shows(
    tmp_path: Path, write: Callable[[Path], tuple[Camera, list[int]]], first: int
) -> None:
    """Nothing yet, or one wall whose distance in millimetres has the lowest bits 0 by chance."""
    write(tmp_path)
    bits = 3 if write is sun3d else 0
    cv2.imwrite(str(min((tmp_path / "depth").iterdir())), np.full(SIZE[::-1], first << bits, dtype=np.uint16))
    far = max((tmp_path / "depth").iterdir())
    image = cv2.imread(str(far), cv2.IMREAD_UNCHANGED)
    image[-1] = (8200 << bits | 8200 >> 16 - bits) & 0xFFFF
    cv2.imwrite(str(far), image)
    assert layout_of(tmp_path).rotated_bits == bits


@pytest.mark.parametrize(
    ("names", "stamps_ms"),
    [
        (["frame_0007_640x480", "frame_0010_640x480"], [7e3 / 30, 1e4 / 30]),
        (["0007_cam1", "0010_cam1"], [7e3 / 30, 1e4 / 30]),
        (["seq-01-000007", "seq-01-000010"], [7e3 / 30, 1e4 / 30]),
        (["run_7_1700000000123", "run_8_1700000000156"], [1_700_000_000_123, 1_700_000_000_156]),
        (["1700000000_999000000", "1700000001_032000000"], [1_700_000_000_999, 1_700_000_001_032]),
        (["1700000000-999000", "1700000001-032000"], [1_700_000_000_999, 1_700_000_001_032]),
        (["1700000000_999000000", "1700000001_32000000"], [1_700_000_000_999, 1_700_000_001_032]),
        (["1700000000_000007", "1700000000_000010"], [7e3 / 30, 1e4 / 30]),
        (["c_Color_1700000000123.0", "c_Color_1700000000156.000"], [1_700_000_000_123, 1_700_000_000_156]),
        (["7", "._8", "10"], [7e3 / 30, 1e4 / 30]),
    ],
)
def test_of_the_numbers_in_names_the_one_counts_that_differs(
    tmp_path: Path, names: list[str], stamps_ms: list[float]
) -> None:
    for name in names:
        (tmp_path / f"{name}.png").touch()
    found = by_stamp(tmp_path, images_in(tmp_path))
    assert [entry.stamp for entry in found] == [round(ms * 10**6) for ms in stamps_ms]


def test_a_name_whose_number_is_no_time_is_left_out_and_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    for name in ("20240105101112123456", "20240105101112189012", "7"):
        (tmp_path / f"{name}.png").touch()
    assert [entry.stamp for entry in by_stamp(tmp_path, images_in(tmp_path))] == [round(7e9 / 30)]
    assert "20240105101112123456.png: left out, with 1 more: the number in its name is neither" in caplog.text


def test_hidden_files_are_no_part_of_a_folder(tmp_path: Path) -> None:
    camera, stamps = open3d(tmp_path)
    for file in [*tmp_path.rglob("*.png"), *tmp_path.rglob("*.jpg"), tmp_path / "intrinsic.json"]:
        file.with_name(f"._{file.name}").write_bytes(b"Mac OS X")
    found = layout_of(tmp_path)
    assert found.camera == camera
    assert [entry.stamp for entry in found.color] == [entry.stamp for entry in found.depth] == stamps


@pytest.mark.parametrize("write", [scannet, eth3d, open3d])
def test_the_camera_of_a_folder_is_known_though_its_first_images_are_damaged(
    tmp_path: Path, write: Callable[[Path], object]
) -> None:
    write(tmp_path)
    before = layout_of(tmp_path)
    for entry in before.color[:2]:
        (tmp_path / entry.values[0]).write_bytes((tmp_path / entry.values[0]).read_bytes()[:50])
    assert before.camera is not None
    assert layout_of(tmp_path).camera == before.camera


@pytest.mark.parametrize(("color_folder", "depth_folder"), [("Color", "Depth"), ("RGB", "depth"), ("images", "depths")])
def test_folders_of_a_pair_may_be_spelt_in_other_ways(tmp_path: Path, color_folder: str, depth_folder: str) -> None:
    camera, _ = open3d(tmp_path)
    (tmp_path / "color").rename(tmp_path / color_folder)
    (tmp_path / "depth").rename(tmp_path / depth_folder)
    info, *rest = open_source(str(tmp_path), SourceOptions(topics=TOPICS)).messages()
    assert decode_camera_info(info) == camera
    assert len(rest) == 2 * FRAMES


@pytest.mark.parametrize("written", [np.ravel, np.array, np.transpose])
def test_open3ds_matrix_may_lie_by_rows_or_by_columns(
    tmp_path: Path, written: Callable[[np.ndarray], np.ndarray]
) -> None:
    camera, _ = open3d(tmp_path)
    content = {"width": 64, "height": 48, "intrinsic_matrix": written(camera.matrix).tolist()}
    (tmp_path / "intrinsic.json").write_text(json.dumps(content))
    assert layout_of(tmp_path).camera == camera


def test_a_matrix_that_is_none_of_intrinsics_is_told(tmp_path: Path) -> None:
    open3d(tmp_path)
    content = {"width": 64, "height": 48, "intrinsic_matrix": [60, 0, 31.5, 0, 61, 23.5, 0, 0, 2]}
    (tmp_path / "intrinsic.json").write_text(json.dumps(content))
    with pytest.raises(ConfigError, match="the third row is not 0 0 1"):
        layout_of(tmp_path)


def test_depth_of_another_size_is_registered_to_colour(tmp_path: Path) -> None:
    scannet(tmp_path)
    for i in range(FRAMES):
        cv2.imwrite(str(tmp_path / "color" / f"{i}.png"), color(i, (128, 96)))
    np.savetxt(tmp_path / "intrinsic" / "intrinsic_color.txt", [[120, 0, 63.5], [0, 120, 47.5], [0, 0, 1]])
    np.savetxt(tmp_path / "intrinsic" / "intrinsic_depth.txt", [[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]])
    messages = open_source(str(tmp_path), SourceOptions(topics=TOPICS)).messages()
    mm = decode_depth(next(message for message in messages if message.topic == TOPICS.depth))
    assert mm.shape == (96, 128)
    assert (mm[10:-4, 4:-4] == 1500).all()


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_depth_in_other_pixels_than_colours_is_brought_to_them(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, factor: float
) -> None:
    """As telephones export it: a smaller image of what colour sees. An edge stays where it is, and a size beside it."""
    camera, _ = open3d(tmp_path)
    image = np.full(SIZE[::-1], 1503, dtype=np.uint16)
    image[:, 32:] = 2503
    for file in (tmp_path / "depth").iterdir():
        size = round(factor * SIZE[0]), round(factor * SIZE[1])
        cv2.imwrite(str(file), cv2.resize(image, size, interpolation=cv2.INTER_NEAREST))
    messages = list(open_source(str(tmp_path), SourceOptions(topics=TOPICS)).messages())
    for message in messages:
        if message.topic == TOPICS.depth:
            assert np.array_equal(decode_depth(message), image)
    assert f"depth of {size[0]} x {size[1]} pixels is taken as registered to colour of 64 x 48" in caplog.text
    _, kept = depth_images_of(str(tmp_path), None)
    assert kept is not None
    assert kept.color_camera == camera


def test_depth_is_not_brought_to_a_calibration_of_another_size(tmp_path: Path) -> None:
    camera, _ = open3d(tmp_path)
    half = {"width": 32, "height": 24, "intrinsic_matrix": (camera.matrix * [[0.5], [0.5], [1.0]]).tolist()}
    (tmp_path / "intrinsic.json").write_text(json.dumps(half))
    messages = list(open_source(str(tmp_path), SourceOptions(topics=TOPICS)).messages())
    assert {decode_depth(m).shape for m in messages if m.topic == TOPICS.depth} == {SIZE[::-1]}


def test_depth_of_another_shape_than_colour_is_of_another_camera(tmp_path: Path) -> None:
    open3d(tmp_path)
    for file in (tmp_path / "depth").iterdir():
        cv2.imwrite(str(file), np.full((40, 50), 1503, dtype=np.uint16))
    messages = list(open_source(str(tmp_path), SourceOptions(topics=TOPICS)).messages())
    assert {decode_depth(message).shape for message in messages if message.topic == TOPICS.depth} == {(40, 50)}


def test_raw_depth_of_a_kinect_is_registered_to_colour(tmp_path: Path) -> None:
    """A post 1.2 m before the depth camera stands elsewhere in colour: another focal length, and 2.5 cm to the side."""
    for i in range(FRAMES):
        cv2.imwrite(str(tmp_path / f"frame-{i:06}.color.png"), color(i, (640, 480)))
        image = np.full((480, 640), 65535, dtype=np.uint16)
        image[:, 500:520] = 1200
        cv2.imwrite(str(tmp_path / f"frame-{i:06}.depth.png"), image)
    messages = open_source(str(tmp_path), SourceOptions(topics=TOPICS)).messages()
    mm = decode_depth(next(message for message in messages if message.topic == TOPICS.depth))
    seen = np.flatnonzero(mm[240] == 1200)
    left, right = 525.0 * ((np.array([499.5, 519.5]) - 320.0) / 585.0 - 0.025 / 1.2) + 319.5
    assert seen[0] == pytest.approx(left, abs=1.0)
    assert seen[-1] == pytest.approx(right, abs=1.0)


def test_a_calibration_that_says_no_unit_leaves_that_of_the_layout(tmp_path: Path) -> None:
    scannet(tmp_path)
    (tmp_path / "own.yaml").write_text(calibration_text(Calibration(Camera(*SIZE, 60.0, 61.0, 0.0, 0.0))))
    own = tmp_path / "own.yaml"
    own.write_text(re.sub("depth_scale: .*\n", "", own.read_text()))
    messages = open_source(str(tmp_path), SourceOptions(topics=TOPICS, camera=own)).messages()
    assert decode_depth(next(message for message in messages if message.topic == TOPICS.depth)).max() == 1500
    assert depth_images_of(str(tmp_path), own)[0] == depth_images_of(str(tmp_path), None)[0] == 1000.0


def test_depth_is_registered_as_when_its_calibration_was_found(tmp_path: Path) -> None:
    seven_scenes(tmp_path)
    _, found = depth_images_of(str(tmp_path), None)
    assert found is not None
    calibrated = Camera(*SIZE, 53.0, 54.0, 29.0, 26.0)
    own = tmp_path / "camera-calibrated.yaml"
    own.write_text(calibration_text(Calibration(calibrated, 1000.0)) + registration_text(found))
    before, after = (
        [decode_depth(m) for m in open_source(str(tmp_path), options).messages() if m.topic == TOPICS.depth]
        for options in (SourceOptions(topics=TOPICS), SourceOptions(topics=TOPICS, camera=own))
    )
    assert all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))
    _, kept = depth_images_of(str(tmp_path), own)
    assert kept is not None
    assert (kept.depth_camera, kept.color_camera) == (found.depth_camera, found.color_camera)


def test_depth_of_a_camera_that_the_folders_calibration_describes_is_registered(tmp_path: Path) -> None:
    eth3d(tmp_path)
    (tmp_path / "calibration.txt").unlink()
    depth_camera = Camera(*SIZE, 30.0, 30.5, 31.5, 23.5)
    registration = DepthRegistration(depth_camera, Camera(*SIZE, 60.0, 61.0, 31.5, 23.5), np.eye(4))
    text = calibration_text(Calibration(registration.color_camera)) + registration_text(registration)
    (tmp_path / "camera.yaml").write_text(text)
    messages = open_source(str(tmp_path), SourceOptions(topics=TOPICS)).messages()
    mm = decode_depth(next(message for message in messages if message.topic == TOPICS.depth))
    assert (mm == 1500).all()  # the middle of depth's view fills colour's: its first row, without depth, lies outside


def test_a_pose_that_was_lost_and_a_file_that_is_none_are_left_out(tmp_path: Path) -> None:
    seven_scenes(tmp_path)
    np.savetxt(tmp_path / "frame-000001.pose.txt", np.full((4, 4), -np.inf))
    (tmp_path / "frame-000002.pose.txt").write_text("lost")
    assert [entry.stamp for entry in layout_of(tmp_path).truth] == [0, 10**8]


def test_what_cannot_be_used_is_told(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="nor a folder of images: TUM's"):
        open_source(str(tmp_path), SourceOptions())
    with pytest.raises(SourceError, match="no images in a layout"):
        layout_of(tmp_path)
    scannet(tmp_path)
    (tmp_path / "intrinsic" / "intrinsic_color.txt").write_text("60 0 0")
    with pytest.raises(ConfigError, match=r"intrinsic_color.txt: give a matrix"):
        open_source(str(tmp_path), SourceOptions())
    for file in (tmp_path / "depth").iterdir():
        file.unlink()
    (tmp_path / "intrinsic" / "intrinsic_color.txt").unlink()
    with pytest.raises(SourceError, match="color/ or depth/ lists no images of depth"):
        open_source(str(tmp_path), SourceOptions())


def test_images_of_a_pair_keep_the_stamps_of_their_own(tmp_path: Path) -> None:
    icl_nuim(tmp_path)
    lines = [f"{i / 30:.6f} depth/{i}.png {i / 30 + 0.012:.6f} rgb/{i}.png" for i in range(FRAMES)]
    (tmp_path / "associations.txt").write_text("\n".join(lines))
    found = layout_of(tmp_path)
    late_ms = [(c.stamp - d.stamp) * 1e-6 for c, d in zip(found.color, found.depth, strict=True)]
    assert late_ms == pytest.approx([12.0] * FRAMES, abs=1e-3)
    (tmp_path / "associations.txt").write_text("0.1 depth/0.png rgb/0.png later")
    with pytest.raises(SourceError, match=r"'rgb/0.png' is not a time stamp"):
        layout_of(tmp_path)


def test_a_folder_of_icl_nuim_is_known_by_its_true_poses_whatever_its_name(tmp_path: Path) -> None:
    icl_nuim(tmp_path)
    (tmp_path / "camera.yaml").unlink()
    for i in range(FRAMES):
        cv2.imwrite(str(tmp_path / "rgb" / f"{i}.png"), color(i, (640, 480)))
        cv2.imwrite(str(tmp_path / "depth" / f"{i}.png"), np.full((480, 640), 10_000, dtype=np.uint16))
    info = next(iter(open_source(str(tmp_path), SourceOptions(topics=TOPICS)).messages()))
    assert decode_camera_info(info) == Camera(640, 480, 481.2, 480.0, 319.5, 239.5)


@pytest.mark.parametrize("name", ["associated.txt", "assoc.txt"])
def test_a_list_of_pairs_may_have_other_names(tmp_path: Path, name: str) -> None:
    """Without it colour and depth are a pair of folders, in millimetres."""
    others_with_associations(tmp_path)
    before = layout_of(tmp_path)
    (tmp_path / "associations.txt").rename(tmp_path / name)
    after = layout_of(tmp_path)
    assert (after.depth_scale, after.color, after.truth) == (5000.0, before.color, before.truth)


@pytest.mark.parametrize("write", [sun3d, eth3d])
@pytest.mark.parametrize("scaled", [1.0, 2.0, 0.5])
def test_intrinsics_of_images_of_another_size_are_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, write: Callable[[Path], object], scaled: float
) -> None:
    """Whoever makes images smaller often leaves the file beside them as it was."""
    write(tmp_path)
    for i, file in enumerate(file for folder in ("rgb", "image") for file in sorted((tmp_path / folder).glob("*"))):
        cv2.imwrite(str(file), color(i, (round(SIZE[0] / scaled), round(SIZE[1] / scaled))))
    assert layout_of(tmp_path).camera is not None
    assert ("seems to be for images of some 63 x 47" in caplog.text) == (scaled != 1.0)


def test_a_file_that_holds_no_intrinsics_is_told_and_left_aside(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    eth3d(tmp_path)
    (tmp_path / "calibration.txt").write_text("60 61 thirty 23.5\n")
    assert layout_of(tmp_path).camera is None
    assert "calibration.txt is left aside" in caplog.text


def test_an_axis_that_points_up_is_told_with_the_remedy() -> None:
    with pytest.raises(ConfigError, match=r"fy is negative.*give 480"):
        Camera(640, 480, 481.2, -480.0, 319.5, 239.5)


@pytest.mark.parametrize(
    ("name", "fx"), [("rgbd_bonn_balloon", 542.822841), ("ICL-NUIM-lr0", 481.2), ("living_room_traj0_frei_png", 481.2)]
)
def test_published_cameras_are_known_by_the_folders_name(name: str, fx: float) -> None:
    camera = tum_camera(Path(name), (640, 480))
    assert camera is not None
    assert camera.fx == fx
    assert tum_camera(Path(name), (320, 240)) is None


@pytest.mark.parametrize("with_intrinsics", [True, False])
@pytest.mark.parametrize(("distance_m", "is_told"), [(1.5, True), (0.8, False)])
def test_a_pair_of_folders_in_tums_units_is_told_what_to_write_where(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, with_intrinsics: bool, distance_m: float, is_told: bool
) -> None:
    """A first image may be black. By the line that is named, depth is right and nothing is told."""
    open3d(tmp_path)
    if not with_intrinsics:
        (tmp_path / "intrinsic.json").unlink()
    for i, file in enumerate(sorted((tmp_path / "depth").iterdir())):
        cv2.imwrite(str(file), np.full(SIZE[::-1], 5000 * distance_m if i else 0, dtype=np.uint16))

    def told() -> list[str]:
        caplog.clear()
        open_source(str(tmp_path), SourceOptions(topics=TOPICS))
        return [record.getMessage() for record in caplog.records if "says no depth_scale" in record.getMessage()]

    assert len(told()) == is_told
    for said in told():
        assert "1000 units a metre are taken (millimetres), by which half of the depth images is beyond 7.50 m" in said
        assert f"write a file {tmp_path / 'camera.yaml'} with the line depth_scale: 5000" in said
    (tmp_path / "camera.yaml").write_text("depth_scale: 5000\n")
    assert told() == []


def test_depth_that_is_published_is_not_doubted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder = tmp_path / "rgbd_dataset_freiburg1_hall"
    folder.mkdir()
    eth3d(folder)
    (folder / "calibration.txt").unlink()
    for i in range(FRAMES):
        cv2.imwrite(str(folder / "depth" / f"{i}.png"), np.full((480, 640), 45000, dtype=np.uint16))
        cv2.imwrite(str(folder / "rgb" / f"{i}.png"), color(i, (640, 480)))
    open_source(str(folder), SourceOptions(topics=TOPICS))
    assert "unlikely" not in caplog.text
