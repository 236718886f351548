"""A wrong call is refused before anything is started or touched, with the reason and status 2."""

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from refused import process_as_it_was, refusal
from typer.testing import CliRunner

from odom.cli import app
from odom.frame import Camera, Stamp
from odom.service.run_folder import held, new_folder
from odom.wire import Topics, codec
from odom.wire.recording import RecordingWriter

CAMERA = """
image_width: 640
image_height: 480
camera_matrix: {data: [525, 0, 319.5, 0, 525, 239.5, 0, 0, 1]}
"""
RESULTS = ("trajectory.txt", "odometry.txt", "report.json", "plot.png", "session.rrd", "notes.txt")


@pytest.fixture(autouse=True)
def here(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    monkeypatch.chdir(tmp_path)
    with process_as_it_was():
        yield


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A TUM folder with everything but pictures."""
    path = tmp_path / "desk"
    path.mkdir()
    for name in ("rgb", "depth"):
        (path / f"{name}.txt").write_text(f"100.0 {name}/100.0.png\n")
    (path / "camera.yaml").write_text(CAMERA)
    return path


def record(path: Path) -> None:
    """A recording of a single frame."""
    topics, stamp = Topics(), Stamp(10**18)
    with RecordingWriter(path) as writer:
        writer.write(codec.encode_camera_info(topics.camera_info, stamp, Camera(64, 48, 50.0, 50.0, 32.0, 24.0)))
        writer.write(codec.encode_color(topics.color, stamp, np.zeros((48, 64, 3), np.uint8)))
        writer.write(codec.encode_depth(topics.depth, stamp, np.zeros((48, 64), np.uint16)))


WRONG = [
    (("typo.mcap",), "typo.mcap: no such file"),
    (("desk/camera.yaml",), "neither an .mcap recording"),
    (("desk", "--camera", "typo.yaml"), "typo.yaml cannot be read"),
    (("desk", "--camera", "half.yaml"), "half.yaml lacks camera_matrix; README shows a whole file"),
    (("desk", "--option", "foo=1"), "has no use for --option"),
    (("desk", "--option", "foo"), "give name=value"),
    (("desk", "--topic", "color=/camera"), "has no use for --topic"),
    (("desk", "--seconds", "5"), "has no use for --seconds"),
    (("desk", "--sensor", "kinect2"), "has no use for --sensor"),
    (("desk", "--live"), "has no use for --live"),
    (("desk", "--sensor-option=--depth=rvl"), "has no use for --depth"),
    (("desk", "--sensor-option=--nonsense"), "No such option: --nonsense"),
    (("desk", "--rate", "2"), "speed of --realtime"),
    (("desk", "--start", "2", "--end", "1"), "--end 1 is not behind --start 2"),
    (("desk", "--start", "nan"), "--start"),
    (("desk", "--end", "inf"), "--end inf"),
    (("desk", "--start", "1e300"), "--start 1e+300: give at most 1e+08 seconds"),
    (("desk", "--end", "1305031102.2"), "counted from the beginning"),
    (("arena", "--seconds", "1e300"), "--seconds 1e+300"),
    (("arena", "--seconds", "0"), "--seconds"),
    (("desk", "--namespace", "truth"), "give another name"),
    (("desk", "--namespace", "a b"), "give letters"),
    (("desk", "--headless", "--web"), "contradict"),
    (("desk", "--record", "desk/rgb.txt"), "is what would be read"),
    (("desk", "--record", "desk/rgb.txt/new.mcap"), "nothing can be written"),
    (("desk", "--record", "desk/rgb.txt", "--overwrite"), "is what would be read"),
    (("old.mcap", "--topic", "color=/elsewhere"), "--topic color=/elsewhere: not in the recording"),
    (("old.mcap", "--record", "old.mcap"), "is what would be read"),
    (("old.mcap", "--record", "old.mcap", "--overwrite"), "is what would be read"),
    (("desk", "--record", "new.bag"), "give a name that ends with .mcap"),
    (("desk", "--record", "old.mcap"), "replace it with --overwrite"),
    (("desk", "--record", "left.mcap", "--overwrite"), "`odom recover left.mcap.part OUT.mcap` saves it"),
    (("desk", "--config", "typo.yaml"), "typo.yaml"),
    (("desk", "--config", "zenoh.yaml"), "wire.zenoh: 'transport/lnk' cannot be set"),
    (("arena", "--camera", "desk/camera.yaml"), "has no use for --camera"),
    (("arena", "--option", "walls=7"), "walls"),
    (("arena", "--sensor", "kinect2", "--option", "walls=7"), "walls"),
    (("arena", "--option", "mocap_offset_s=inf"), "mocap_offset_s"),
    (("arena", "--option", "marker_deg=1e300"), "marker_deg"),
    (("optitrack:",), "optitrack:: give optitrack:SERVER"),
    (("optitrack:motive",), "has no images"),
    (("kinect", "--start", "1"), "has no use for --start"),
    (("kinect", "--option", "fps=0"), "fps"),
]


@pytest.mark.parametrize(("arguments", "named"), WRONG, ids=[" ".join(arguments) for arguments, _ in WRONG])
def test_a_refused_run_starts_nothing_and_touches_nothing(
    tmp_path: Path, folder: Path, arguments: tuple[str, ...], named: str
) -> None:
    record(tmp_path / "old.mcap")
    (tmp_path / "half.yaml").write_text("image_width: 640\nimage_height: 480\n")
    (tmp_path / "zenoh.yaml").write_text("wire: {zenoh: {transport/lnk: 1}}\n")
    (tmp_path / "left.mcap.part").write_bytes(b"what a recorder that was killed has left")
    out = tmp_path / "good"
    out.mkdir()
    for name in RESULTS:
        (out / name).write_text(f"{name} of the run before")
    before = sorted(tmp_path.rglob("*"))
    assert named in refusal("run", *arguments, *([] if "--web" in arguments else ["--headless"]), "--out", out)
    assert sorted(tmp_path.rglob("*")) == before
    assert all((out / name).read_text() == f"{name} of the run before" for name in RESULTS)
    assert named in refusal("run", *arguments, "--headless")  # nor is a folder of the default name left
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    "recording", ["new", "new/results", "new/results/report.json", "new/results/truth_cap.txt", "a.map"]
)
def test_a_recording_where_the_run_itself_writes_is_refused_before_it(
    folder: Path, tmp_path: Path, recording: str
) -> None:
    before = sorted(tmp_path.rglob("*"))
    words = refusal(
        "run", folder, "--headless", "--out", "new/results", "--map", "a.map", "--record", recording, "--overwrite"
    )
    assert "is what the run itself writes" in words
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("command", ["sensor", "import", "doctor"])
def test_every_command_refuses_what_its_source_has_no_use_for(folder: Path, command: str) -> None:
    output = ["new.mcap"] if command == "import" else []
    assert "has no use for --option" in refusal(command, folder, *output, "--option", "foo=1")
    assert "has no use for --topic" in refusal(command, folder, *output, "--topic", "color=/camera")
    assert "no such file" in refusal(command, "typo.mcap", *output)


def test_a_check_of_a_source_says_nothing_of_a_good_one(folder: Path) -> None:
    done = CliRunner().invoke(app, ["sensor", str(folder), "--check"])
    assert (done.exit_code, done.output) == (0, "")


def test_a_second_run_into_a_folder_is_refused_by_the_name_of_its_holder(folder: Path, tmp_path: Path) -> None:
    with held(tmp_path / "out"):
        for command in (("run", folder, "--headless"), ("serve",)):
            words = refusal(*command, "--out", tmp_path / "out")
            assert f"is being written by process {os.getpid()}" in words
    with held(tmp_path / "out"):
        pass
    assert not any((tmp_path / "out").iterdir())


OTHERS = [
    (("batch", "old.mcap", "--out", "all", "--camera", "nosuch.yaml"), "nosuch.yaml cannot be read"),
    (("batch", "old.mcap", "--out", "all", "--start", "5", "--end", "3"), "--end 3 is not behind --start 5"),
    (("batch", "old.mcap", "--out", "desk/rgb.txt"), "nothing can be written in"),
    (("export", "old.mcap", "--to", "tum", "--out", "all", "--mask", "desk/rgb.txt"), "is no image that can be read"),
    (("doctor", "optitrack:motive"), "`odom sensor optitrack:motive --namespace mocap`"),
    (("mask", "optitrack:motive", "--out", "mask.png"), "has no images"),
    (("calibrate", "optitrack:motive", "--out", "new.yaml"), "has no images"),
    (("calibrate", "kinect", "--out", "new.yaml"), "`odom run kinect --record walk.mcap`"),
    (("calibrate", "old.mcap", "ros2:/camera", "--out", "new.yaml"), "ros2:/camera is live: record it first"),
    (("recover", "old.mcap", "old.mcap"), "choose another name"),
    (("recover", "old.mcap", "desk/rgb.txt", "--overwrite"), "ends with .mcap"),
    (("recover", "old.mcap", "new.bag"), "ends with .mcap"),
    (("record", "new"), "ends with .mcap"),
    (("record", "take-{time}.bag"), "ends with .mcap"),
    (("record", "old.mcap"), "--overwrite"),
    (("import", "desk", "old.mcap"), "--overwrite"),
    (("eval", "nosuch"), "nosuch: no such file"),
    (("eval", "desk/rgb.txt", "nosuch"), "nosuch: no such file"),
    (("bench", "sensitivity", "nosuch", "--only", "frontend.*"), "nosuch: no such file"),
    (("bench", "sensitivity", "old.mcap", "--markdown", "desk/rgb.txt/t.md"), "nothing can be written in"),
    (("map", "info", "desk"), "desk is a folder: give the name of a map's file"),
    (("run", "desk", "--headless", "--map", "desk"), "desk is a folder: give the name of a map's file"),
    (("map", "export", "desk.map", "--out", "old.mcap"), "nothing can be written in"),
    (("--password-file", "desk/rgb.txt", "record", "new.mcap"), "--user"),
]


@pytest.mark.parametrize(("arguments", "named"), OTHERS, ids=[" ".join(arguments) for arguments, _ in OTHERS])
def test_other_commands_refuse_a_wrong_call_with_what_to_do_and_touch_nothing(
    tmp_path: Path, folder: Path, arguments: tuple[str, ...], named: str
) -> None:
    record(tmp_path / "old.mcap")
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    assert named in refusal(*arguments)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before


@pytest.mark.parametrize(
    ("command", "option"),
    [("export", ("--to", "tum", "--out")), ("calibrate", ("--out",)), ("mask", ("--out",)), ("doctor", ("--json",))],
)
@pytest.mark.parametrize("place", ["desk/camera.yaml/out.yaml", "/proc/none/out.yaml"])
def test_where_nothing_can_be_written_is_found_before_the_work(
    folder: Path, command: str, option: tuple[str, ...], place: str
) -> None:
    assert "nothing can be written in" in refusal(command, folder, *option, place)


def test_a_folder_that_cannot_be_written_is_refused(folder: Path) -> None:
    assert "cannot be written" in refusal("run", folder, "--headless", "--out", folder / "camera.yaml")


@pytest.mark.parametrize(
    "command",
    [
        ("run", "desk", "--headless"),
        ("serve",),
        ("batch", "desk"),
        ("export", "desk", "--to", "tum"),
        ("map", "export", "desk.map"),
        ("bench", "robustness", "desk"),
    ],
)
def test_a_folder_without_a_name_is_not_taken_for_the_present_one(folder: Path, command: tuple[str, ...]) -> None:
    assert "--out" in (words := refusal(*command, "--out", ""))
    assert "is empty" in words


def test_runs_that_start_together_get_folders_of_their_own(tmp_path: Path) -> None:
    wanted = tmp_path / "out" / "arena-20260101-000000"
    assert [new_folder(wanted).name for _ in range(3)] == [wanted.name, f"{wanted.name}-2", f"{wanted.name}-3"]
