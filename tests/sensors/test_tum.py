from collections import Counter
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from odom.errors import ConfigError, SourceError
from odom.frame import Camera, Stamp
from odom.service.calibration_offer import keep_depth_images
from odom.wire import Topics, truth
from odom.wire.assembler import FrameAssembler
from odom.wire.codec import cdr, decode_camera_info, decode_color, decode_depth, decode_pose
from odom.wire.pairing import Pairer
from sensors.calibration_file import load_calibration
from sensors.catalogue import open_source
from sensors.default_camera import tum_camera
from sensors.depth_images import depth_table
from sensors.source import SourceOptions, refused_images
from sensors.tum import read_list

CAMERA = """image_width: 32
image_height: 24
camera_matrix: {rows: 3, cols: 3, data: [30, 0, 16, 0, 31, 12, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0.2]}
"""
FRAMES = 4
TOPICS = Topics()


def write_folder(
    folder: Path, extension: str = "jpg", scale: float | None = None, size: tuple[int, int] = (32, 24)
) -> Path:
    (folder / "rgb").mkdir(parents=True)
    (folder / "depth").mkdir()
    rgb, depth = ["# colour"], ["# depth"]
    for i in range(FRAMES):
        color = np.full((*size[::-1], 3), (10 * i, 100, 200), dtype=np.uint8)
        cv2.imwrite(str(folder / "rgb" / f"{i}.{extension}"), color)
        cv2.imwrite(str(folder / "depth" / f"{i}.png"), np.full(size[::-1], 5003 + i, dtype=np.uint16))
        rgb.append(f"100.{i}00000123 rgb/{i}.{extension}")
        depth.append(f"100.{i}10000 depth/{i}.png")
    (folder / "rgb.txt").write_text("\n".join(rgb) + "\n")
    (folder / "depth.txt").write_text("\n".join(depth) + "\n")
    (folder / "groundtruth.txt").write_text(
        "# truth\n99.9 1 2 3 0 0 0 1\n100.05 1 2 3 0 0 0.7071 0.7071\n900 0 0 0 0 0 0 1\n"
    )
    (folder / "camera.yaml").write_text(CAMERA + (f"depth_scale: {scale}\n" if scale else ""))
    return folder


def keys(folder: Path, options: SourceOptions | None = None) -> Counter[str]:
    return Counter(message.topic for message in open_source(str(folder), options or SourceOptions()).messages())


def camera_of(folder: Path) -> Camera:
    return decode_camera_info(next(iter(open_source(str(folder), SourceOptions()).messages())))


@pytest.mark.parametrize("extension", ["jpg", "png"])
def test_a_folder_goes_out_in_order_with_its_colour_files_unchanged(tmp_path: Path, extension: str) -> None:
    folder = write_folder(tmp_path / "tum", extension)
    topics = Topics("kinect")
    source = open_source(str(folder), SourceOptions(topics=topics))
    messages = list(source.messages())
    assert source.lossless
    assert source.length == FRAMES
    assert messages[0].topic == topics.camera_info
    assert [message.stamp for message in messages[1:]] == sorted(message.stamp for message in messages[1:])
    colors = [message for message in messages if message.topic == topics.color_compressed]
    assert [message.stamp for message in colors] == [100_000_000_123 + i * 100_000_000 for i in range(FRAMES)]
    for i, message in enumerate(colors):
        file = (folder / "rgb" / f"{i}.{extension}").read_bytes()
        assert cdr.deserialise(message, cdr.COMPRESSED_IMAGE).data.tobytes() == file
    assembler = FrameAssembler(topics)
    frames = [frame for message in messages for frame in assembler.feed(message)]
    assert len(frames) == FRAMES
    assert assembler.camera == load_calibration(folder / "camera.yaml").camera
    assert np.array_equal(frames[2].depth_mm, np.full((24, 32), 1001))
    red, green, blue = frames[2].color[0, 0]
    assert (abs(int(red) - 200) <= 3, abs(int(green) - 100) <= 3, abs(int(blue) - 20) <= 3) == (True, True, True)


def test_truth_near_the_images_goes_out_as_a_body(tmp_path: Path) -> None:
    messages = list(open_source(str(write_folder(tmp_path / "tum")), SourceOptions()).messages())
    poses = [decode_pose(message) for message in messages if message.topic == truth("camera")]
    assert [pose.stamp for pose in poses] == [99_900_000_000, 100_050_000_000]
    assert poses[1].T_parent_child[:3, 3].tolist() == [1, 2, 3]
    assert np.allclose(poses[1].T_parent_child[:3, :3] @ [1, 0, 0], [0, 1, 0], atol=1e-6)


@pytest.mark.parametrize("start", [0.0, 0.1])
def test_truth_of_another_time_than_the_images_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, start: float
) -> None:
    folder = write_folder(tmp_path / "tum")
    keys(folder, SourceOptions(start=start))
    assert "another time" not in caplog.text
    (folder / "groundtruth.txt").write_text("0.00 1 2 3 0 0 0 1\n0.05 1 2 3 0 0 0 1\n")
    assert keys(folder, SourceOptions(start=start))[truth("camera")] == 0
    assert "its 2 true poses, from 0.000 to 0.050 s, are of another time than its images, from 100.0" in caplog.text


@pytest.mark.parametrize("scale", [1000.0, 5000.0, 1234.5, 100.0])
def test_depth_becomes_millimetres_rounded_once(tmp_path: Path, scale: float) -> None:
    folder = write_folder(tmp_path / "tum", scale=scale)
    message = next(
        m for m in open_source(str(folder), SourceOptions()).messages() if m.topic.endswith("depth/image_raw")
    )
    assert decode_depth(message)[0, 0] == round(5003 * 1000 / scale)
    table = depth_table(scale)
    every = np.arange(65536) if table is None else table
    exact = np.arange(65536) * 1000 / scale
    inside = np.rint(exact) < 65536
    assert np.abs(every[inside] - exact[inside]).max() <= 0.5
    assert not every[~inside].any()


def rewritten(folder: Path, write: Callable[[Path, np.ndarray], None], suffix: str) -> None:
    """Write the first image of colour and of depth once more, as another file, and list that."""
    for name, old in (("rgb", "jpg"), ("depth", "png")):
        write(folder / name / f"other.{suffix}", cv2.imread(str(folder / name / f"0.{old}"), cv2.IMREAD_UNCHANGED))
        text = (folder / f"{name}.txt").read_text()
        (folder / f"{name}.txt").write_text(text.replace(f"{name}/0.{old}", f"{name}/other.{suffix}"))


@pytest.mark.parametrize("suffix", ["TIF", "webp", "pgm", "bmp", "png"])
def test_images_of_other_formats_are_read_whatever_they_are_called(tmp_path: Path, suffix: str) -> None:
    """OpenCV reads them. A bitmap holds no 16 bits: the depth beside it is a TIFF; so are both files called .png."""
    folder = write_folder(tmp_path / "tum")
    before = list(open_source(str(folder), SourceOptions()).messages())
    formats = {"TIF": ("tiff", "tiff"), "webp": ("webp", "pgm"), "pgm": ("ppm", "pgm"), "bmp": ("bmp", "tiff")}

    def write(file: Path, image: np.ndarray) -> None:
        written = formats.get(suffix, ("tiff", "tiff"))[image.ndim == 2]
        options = [cv2.IMWRITE_WEBP_QUALITY, 101] if written == "webp" else []  # 101: without loss
        file.write_bytes(cv2.imencode(f".{written}", image, options)[1].tobytes())

    rewritten(folder, write, suffix)
    source = open_source(str(folder), SourceOptions())
    after = list(source.messages())
    assert not refused_images(source)
    assert [m.stamp for m in after] == [m.stamp for m in before]
    for old, new in zip(before, after, strict=True):
        if new.topic == TOPICS.color:
            assert np.array_equal(decode_color(new), decode_color(old))
        elif "info" not in new.topic:
            assert new.payload == old.payload
    assert sum(message.topic == TOPICS.color for message in after) == 1


def test_another_format_that_is_cut_is_a_damaged_file(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "tum")
    rewritten(folder, lambda file, image: file.write_bytes(cv2.imencode(".tiff", image)[1].tobytes()[:-9]), "tiff")
    source = open_source(str(folder), SourceOptions())
    list(source.messages())
    assert refused_images(source) == {("colour", "damaged file"): 1, ("depth", "damaged file"): 1}


@pytest.mark.parametrize("suffix", ["npz", "png"])
def test_a_format_that_is_not_read_is_told_from_a_damaged_file(tmp_path: Path, suffix: str) -> None:
    """Whatever the file is called: the last one is JPEG 2000 called .png."""
    folder = write_folder(tmp_path / "tum")

    def write(file: Path, image: np.ndarray) -> None:
        if suffix == "npz":
            np.savez(file, image)
        else:
            file.write_bytes(cv2.imencode(".jp2", cv2.resize(image, (256, 256)))[1].tobytes())

    rewritten(folder, write, suffix)
    (folder / "depth" / "1.png").write_bytes(bytes(500))
    source = open_source(str(folder), SourceOptions())
    list(source.messages())
    other = "of a format that is not read"
    assert refused_images(source) == {("colour", other): 1, ("depth", other): 1, ("depth", "damaged file"): 1}


@pytest.mark.parametrize("start", [0.0, 0.1])
def test_a_part_is_counted_from_the_first_stamp_that_others_follow(tmp_path: Path, start: float) -> None:
    """Some recorders stamp their first images with 0."""
    folder = write_folder(tmp_path / "tum", "png")
    whole = keys(folder, SourceOptions(start=start, end=0.25))
    for name in ("rgb", "depth"):
        file = folder / f"{name}.txt"
        file.write_text(f"0.0 {name}/0.png\n0.0 {name}/0.png\n" + file.read_text())
    part = keys(folder, SourceOptions(start=start, end=0.25))
    for key in ("cam0/depth/image_raw", "cam0/color/image_raw/compressed"):
        assert part[key] == whole[key] + (2 if start == 0 else 0)  # the odometry refuses and counts them


@pytest.mark.parametrize(
    "name", ["rgb/my image {}.jpg", '"rgb/my image {}.jpg"', "rgb\\image{}.JPG", "rgb\\take 2\\image{}.jpg"]
)
def test_names_in_a_list_may_hold_blanks_quotes_and_backslashes(tmp_path: Path, name: str) -> None:
    folder = write_folder(tmp_path / "tum")
    lines = []
    for i in range(FRAMES):
        lines.append(f"100.{i} {name.format(i)}\n")
        file = folder / name.format(i).strip('"').replace("\\", "/")
        file.parent.mkdir(exist_ok=True)
        (folder / "rgb" / f"{i}.jpg").rename(file)
    (folder / "rgb.txt").write_text("".join(lines))
    assert keys(folder)["cam0/color/image_raw/compressed"] == FRAMES


@pytest.mark.parametrize(
    ("line", "name"),
    [
        ("1.5 rgb/cam#1_2.png", "rgb/cam#1_2.png"),
        ("1.5 rgb/a.png # the first", "rgb/a.png"),
        ("1.5 rgb/a,2.png", "rgb/a,2.png"),
        ("1.5,rgb/a.png", "rgb/a.png"),
        ("1.5, rgb/a.png", "rgb/a.png"),
        ("1.5 rgb/a.png,depth/a.png", "rgb/a.png"),
        ("1.5 rgb/a.png, depth/a.png", "rgb/a.png"),
    ],
)
def test_hashes_and_commas_within_a_name_in_a_list_are_parts_of_it(tmp_path: Path, line: str, name: str) -> None:
    file = tmp_path / "rgb.txt"
    file.write_text(f"# stamp, name\n  # and more\n{line}\n")
    (entry,) = read_list(file, 1)
    assert entry.values == (name,)


def test_names_in_a_list_of_pairs_may_hold_blanks(tmp_path: Path) -> None:
    file = tmp_path / "associations.txt"
    file.write_text("1.5 rgb/a b.png 1.6 depth\\a 2 b.png\n")
    (entry,) = read_list(file, 3)
    assert entry.values == ("rgb/a b.png", "1.6", "depth/a 2 b.png")


@pytest.mark.parametrize(("unit", "digits"), [("milliseconds", 3), ("microseconds", 6), ("nanoseconds", 9)])
def test_stamps_in_another_unit_are_known_by_their_digits_and_this_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, unit: str, digits: int
) -> None:
    caplog.set_level("INFO")
    file = tmp_path / "rgb.txt"
    file.write_text(f"{1_311_868_163_250 * 10 ** (digits - 3)} rgb/0.png\n")
    assert [entry.stamp for entry in read_list(file, 1)] == [1_311_868_163_250_000_000]
    assert f"taken for {unit}" in caplog.text


def test_numbers_of_frames_instead_of_stamps_are_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder = write_folder(tmp_path / "tum")
    for name, suffix in (("rgb", "jpg"), ("depth", "png")):
        (folder / f"{name}.txt").write_text("".join(f"{i + 1} {name}/{i}.{suffix}\n" for i in range(FRAMES)))
    messages = list(open_source(str(folder), SourceOptions(topics=TOPICS)).messages())
    stamps = [message.stamp for message in messages if message.topic == TOPICS.depth]
    assert stamps == [round((i + 1) * 1e9 / 30) for i in range(FRAMES)]
    assert "numbers of frames, 30 a second" in caplog.text
    assert "divided by the rate" in caplog.text
    caplog.clear()
    (tmp_path / "camera-calibrated.yaml").write_text("depth_scale: 1.0\n")
    keep_depth_images(tmp_path, str(folder), None)
    assert not caplog.records  # at the end of the run it is not said again
    assert (tmp_path / "camera-calibrated.yaml").read_text() == "depth_scale: 5000.0\n"


def test_a_part_is_played_and_a_round_follows_another(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "tum")
    part = keys(folder, SourceOptions(start=0.1, end=0.3))
    assert part["cam0/color/image_raw/compressed"] == 2
    source = open_source(str(folder), SourceOptions(loop=True))
    stamps: list[int] = []
    for message in source.messages():
        if message.topic.endswith("compressed"):
            stamps.append(message.stamp)
            if len(stamps) == 3 * FRAMES:
                source.close()
    assert len(stamps) == 3 * FRAMES
    assert stamps == sorted(set(stamps))


@pytest.mark.rendered
def test_what_is_live_is_not_looped() -> None:
    with pytest.raises(ConfigError, match="--loop"):
        open_source("arena", SourceOptions(live=True, loop=True, extra=(("half", "1"),)))


def test_a_missing_or_damaged_image_is_left_out_and_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder = write_folder(tmp_path / "tum")
    (folder / "rgb" / "1.jpg").unlink()
    damaged = folder / "depth" / "2.png"
    damaged.write_bytes(damaged.read_bytes()[:40])
    (folder / "rgb" / "3.jpg").write_bytes(b"no image")
    source = open_source(str(folder), SourceOptions())
    counted = Counter(message.topic for message in source.messages())
    source.close()
    source.close()
    assert counted["cam0/color/image_raw/compressed"] == FRAMES - 2
    assert counted["cam0/depth/image_raw"] == FRAMES - 1
    told = [record.getMessage() for record in caplog.records]
    assert [words.count("left out") for words in told] == [1, 1, 1, 1]
    assert told[-1].endswith(
        "left out 1 of colour (damaged file), 1 of colour (no such file), 1 of depth (damaged file)"
    )


def test_of_each_kind_that_is_left_out_one_is_told_and_the_others_counted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = write_folder(tmp_path / "tum")
    for picture in (folder / "depth").iterdir():
        picture.unlink()
    truth = folder / "groundtruth.txt"
    truth.write_text("".join(f"{100 + i / 30} nan 0 0 0 0 0 1\n" for i in range(FRAMES)))
    source = open_source(str(folder), SourceOptions())
    counted = Counter(message.topic for message in source.messages())
    source.close()
    assert counted == {"cam0/color/camera_info": 1, "cam0/color/image_raw/compressed": FRAMES}
    assert len(caplog.records) == 3
    assert f"left out {FRAMES} of depth (no such file), {FRAMES} of truth (no pose)" in caplog.records[-1].getMessage()
    assert refused_images(source) == {("depth", "no such file"): FRAMES}


@pytest.mark.parametrize("content", ["1.0 2.0\n", "first line\n", "100.0 0 0 0 0 0 0 1\n100.1 0 0", b"\xff\xfe\x00"])
def test_truth_that_cannot_be_read_is_said_and_done_without(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, content: str | bytes
) -> None:
    folder = write_folder(tmp_path / "tum")
    (folder / "groundtruth.txt").write_bytes(content if isinstance(content, bytes) else content.encode())
    counted = keys(folder)
    assert counted["cam0/color/image_raw/compressed"] == FRAMES
    assert not any(key.startswith("truth") for key in counted)
    assert ["it goes on without truth" in record.getMessage() for record in caplog.records] == [True]


@pytest.mark.parametrize(
    ("file", "content", "error", "says"),
    [
        ("rgb.txt", "100.0\n", SourceError, "rgb.txt:1"),
        ("depth.txt", "# one\nwhen where\n", SourceError, "depth.txt:2"),
        ("depth.txt", "", SourceError, "lists no images"),
        ("camera.yaml", "image_width: 3\n", ConfigError, "camera_matrix"),
        ("camera.yaml", "[", ConfigError, "cannot be read"),
        ("camera.yaml", "just text", ConfigError, "not a ROS"),
        ("camera.yaml", CAMERA.replace("plumb_bob", "fisheye"), ConfigError, "fisheye"),
        ("camera.yaml", CAMERA.replace("30, 0", ".nan, 0"), ConfigError, "finite"),
        ("camera.yaml", CAMERA + "depth_scale: 0\n", ConfigError, "depth_scale"),
    ],
)
def test_what_is_wrong_with_a_folder_is_named(
    tmp_path: Path, file: str, content: str, error: type[Exception], says: str
) -> None:
    folder = write_folder(tmp_path / "tum")
    (folder / file).write_text(content)
    with pytest.raises(error, match=says):
        open_source(str(folder), SourceOptions())


@pytest.mark.parametrize(
    ("name", "fx"),
    [
        ("rgbd_dataset_freiburg1_xyz", 517.306408),
        ("rgbd_dataset_freiburg2_desk_secret", 520.908620),
        ("fr3_office", 535.4),
        ("tum_fr1_rpy_part", 517.306408),
    ],
)
def test_a_tum_folder_as_downloaded_has_the_published_calibration(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, name: str, fx: float
) -> None:
    folder = write_folder(tmp_path / name, size=(640, 480))
    (folder / "camera.yaml").unlink()
    assert camera_of(folder) == tum_camera(folder, (640, 480))
    assert camera_of(folder).fx == fx
    assert not [record for record in caplog.records if record.levelname == "WARNING"]


def test_the_published_calibration_is_that_of_a_real_recording(shared_data: Path) -> None:
    folder = shared_data / "tum_fr1_xyz"
    assert tum_camera(folder, (640, 480)) == load_calibration(folder / "camera.yaml").camera


@pytest.mark.parametrize("name", ["my_room", "fr4_x", "fr12", "afr1", "freiburg1_small"])
def test_any_other_folder_without_calibration_gets_a_kinects_and_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, name: str
) -> None:
    folder = write_folder(tmp_path / name)
    (folder / "camera.yaml").unlink()
    assert camera_of(folder) == Camera(32, 24, 26.25, 26.25, 15.5, 11.5)
    assert {record.levelname for record in caplog.records} == {"WARNING"}
    assert all(remedy in caplog.text for remedy in ("camera.yaml", "--camera", "no calibration"))


@pytest.mark.parametrize(
    ("value", "remedy"),
    [
        (1000, "add to it the line depth_scale: 1000"),
        (5000, ""),
        (0, ""),
        (60_000, "how many units of depth are a metre"),
    ],
)
def test_a_calibration_without_depth_scale_is_told_where_depth_is_unlikely(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, value: int, remedy: str
) -> None:
    folder = write_folder(tmp_path / "tum")
    for file in (folder / "depth").iterdir():
        cv2.imwrite(str(file), np.full((24, 32), value, dtype=np.uint16))
    list(open_source(str(folder), SourceOptions()).messages())
    assert [remedy in record.getMessage() for record in caplog.records] == [True] * bool(remedy)
    caplog.clear()
    (folder / "camera.yaml").write_text(CAMERA + "depth_scale: 5000\n")
    open_source(str(folder), SourceOptions())
    assert not caplog.records


def test_a_file_of_the_depth_scale_alone_leaves_the_camera_assumed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder = write_folder(tmp_path / "tum")
    (folder / "camera.yaml").write_text("depth_scale: 1000\n")
    source = open_source(str(folder), SourceOptions())
    depth = next(message for message in source.messages() if message.topic == TOPICS.depth)
    assert decode_depth(depth)[0, 0] == 5003
    assert source.is_assumed
    assert "1000 depth units a metre" in caplog.records[0].getMessage()
    (folder / "camera.yaml").write_text("depth_scale: thousand\n")
    with pytest.raises(ConfigError, match="depth_scale"):
        open_source(str(folder), SourceOptions())


@pytest.mark.parametrize(
    ("typed", "meant"), [("dsk", "desk"), ("desk/rbg.txt", "desk/rgb.txt"), ("areena", "arena"), ("xyz", None)]
)
def test_the_nearest_name_is_told_where_a_source_is_not_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, typed: str, meant: str | None
) -> None:
    write_folder(tmp_path / "desk")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError) as refused:
        open_source(typed, SourceOptions())
    assert ("did you mean" in str(refused.value)) == (meant is not None)
    assert meant is None or f"(did you mean {meant}?)" in str(refused.value)


def test_a_named_calibration_takes_the_place_of_the_folders(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "tum")
    elsewhere = tmp_path / "elsewhere.yaml"
    (folder / "camera.yaml").rename(elsewhere)
    assert keys(folder, SourceOptions(camera=elsewhere))["cam0/depth/image_raw"] == FRAMES
    with pytest.raises(ConfigError, match="cannot be read"):
        open_source(str(folder), SourceOptions(camera=tmp_path / "nothing.yaml"))


def test_lists_and_calibration_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "tum")
    expected = keys(folder)
    for name in ("rgb.txt", "depth.txt", "groundtruth.txt", "camera.yaml"):
        file = folder / name
        file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes())
    assert keys(folder) == expected


def test_what_is_no_source_is_said(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such file"):
        open_source(str(tmp_path / "nothing"), SourceOptions())
    with pytest.raises(ConfigError, match="neither"):
        open_source(str(tmp_path), SourceOptions())


@pytest.mark.parametrize("typed", ["", "chess", "chess/seq-01/rgb", "chess/seq-01/rgb.txt"])
def test_a_source_inside_or_above_the_path_is_told(tmp_path: Path, typed: str) -> None:
    (tmp_path / "all" / "chess").mkdir(parents=True)
    folder = write_folder(tmp_path / "all" / "chess" / "seq-01")
    with pytest.raises(ConfigError, match=f"did you mean {folder}\\?"):
        open_source(str(tmp_path / "all" / typed), SourceOptions())


def test_an_archive_is_to_be_unpacked(tmp_path: Path) -> None:
    (tmp_path / "rgbd_dataset_freiburg1_xyz.tgz").touch()
    with pytest.raises(ConfigError, match=r"unpack rgbd_dataset_freiburg1_xyz.tgz first"):
        open_source(str(tmp_path / "rgbd_dataset_freiburg1_xyz.tgz"), SourceOptions())


def test_names_of_columns_may_stand_above_a_list(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "tum")
    before = keys(folder)
    for name, columns in (("rgb", "timestamp filename"), ("groundtruth", "timestamp,tx,ty,tz,qx,qy,qz,qw")):
        (folder / f"{name}.txt").write_text(f"# list\n{columns}\n{(folder / f'{name}.txt').read_text()}")
    assert keys(folder) == before


def test_a_real_recording_becomes_its_frames(shared_data: Path) -> None:
    source = open_source(str(shared_data / "tum_fr1_rpy_part"), SourceOptions(end=3.0))
    assembler = FrameAssembler(Topics(), grey=True)
    frames = [frame for message in source.messages() for frame in assembler.feed(message)]
    frames += assembler.finish()
    assert source.length is not None
    assert len(frames) == source.length
    assert not assembler.malformed.counts
    with_depth = [frame for frame in frames if frame.depth_mm.any()]
    assert len(with_depth) >= source.length - 1
    assert all(500 < np.median(frame.depth_mm[frame.depth_mm > 0]) < 4000 for frame in with_depth)


def test_every_mutually_nearest_pair_of_a_real_kinect_is_found(shared_data: Path) -> None:
    color, depth = (
        np.array([entry.stamp for entry in read_list(shared_data / "tum_fr1_xyz" / name, 1)])
        for name in ("rgb.txt", "depth.txt")
    )
    apart = np.abs(color[:, None] - depth[None])
    nearest_depth, nearest_color = apart.argmin(axis=1), apart.argmin(axis=0)
    mutual = {(color[i], depth[j]) for i, j in enumerate(nearest_depth) if nearest_color[j] == i}
    pairer: Pairer[int, int] = Pairer()
    pairs = []
    for stamp, is_color in sorted([(at, True) for at in color] + [(at, False) for at in depth]):
        add = pairer.add_color if is_color else pairer.add_depth
        pairs += add(Stamp(int(stamp)), 0)
    pairs += pairer.finish()
    assert mutual <= {(pair.color_stamp, pair.depth_stamp) for pair in pairs if pair.depth is not None}
    assert len(mutual) > 0.98 * len(color)


@pytest.mark.parametrize("scale", [None, 1000.0])
def test_a_long_recording_is_read_by_the_compiled_reader_with_the_same_result(
    tmp_path: Path, scale: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_folder(tmp_path / "run", scale=scale)
    cv2.imwrite(str(folder / "depth" / "1.png"), np.full((24, 32), 7, dtype=np.uint8))  # not depth: left out by both
    few = list(open_source(str(folder), SourceOptions()).messages())
    monkeypatch.setattr("sensors.tum._MANY_IMAGES", 1)
    many = list(open_source(str(folder), SourceOptions()).messages())
    assert many == few
