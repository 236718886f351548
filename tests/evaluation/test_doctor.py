"""The doctor names each fault put into a good recording, and only that one."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import drawn
import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from odom.evaluation import Trajectory
from odom.evaluation.diagnosis import Recording, Verdict, examine
from odom.evaluation.diagnosis.stamps import judge_rhythm, rhythm
from odom.frame import RgbdFrame
from odom.geometry import se3
from odom.service.source_sample import collect
from odom.wire import Topics
from sensors.catalogue import open_source
from sensors.source import SourceOptions

SECONDS = 5.0


def shifted(frame: RgbdFrame, pixels: int) -> RgbdFrame:
    depth = np.zeros_like(frame.depth_mm)
    depth[:, pixels:] = frame.depth_mm[:, :-pixels]
    return replace(frame, depth_mm=depth)


def unspoiled(recording: Recording) -> Recording:
    return recording


def depth_shifted(recording: Recording) -> Recording:
    return replace(recording, frames=tuple(shifted(frame, 15) for frame in recording.frames))


def depth_late(recording: Recording) -> Recording:
    """Depth stamped 60 ms late: to each colour frame comes the depth of two frames ago."""
    frames = recording.frames
    pairs = zip(frames[2:], frames[:-2], strict=True)
    late = [replace(new, depth_mm=old.depth_mm, depth_stamp=old.depth_stamp + 60_000_000) for new, old in pairs]
    return replace(recording, frames=tuple(late), depth_stamps=recording.depth_stamps + 60_000_000)


def half_missing(recording: Recording) -> Recording:
    kept = np.random.default_rng(0).random(len(recording.frames)) < 0.5
    frames = tuple(frame for frame, keep in zip(recording.frames, kept, strict=True) if keep)
    return replace(
        recording,
        frames=frames,
        color_stamps=np.array([frame.stamp for frame in frames]),
        depth_stamps=np.array([frame.depth_stamp for frame in frames]),
    )


def every_second_missing(recording: Recording) -> Recording:
    frames = recording.frames[::2]
    return replace(
        recording,
        frames=frames,
        color_stamps=np.array([frame.stamp for frame in frames]),
        depth_stamps=np.array([frame.depth_stamp for frame in frames]),
    )


def focal_wrong(recording: Recording) -> Recording:
    return replace(recording, camera=replace(recording.camera, fx=1.2 * recording.camera.fx))


def both_focals_wrong(recording: Recording) -> Recording:
    camera = recording.camera
    return replace(recording, camera=replace(camera, fx=camera.fx / 1.2, fy=camera.fy / 1.2))


def scale_wrong(recording: Recording) -> Recording:
    def scaled(frame: RgbdFrame) -> RgbdFrame:
        return replace(frame, depth_mm=np.rint(1.04 * frame.depth_mm).astype(np.uint16))

    return replace(recording, frames=tuple(scaled(frame) for frame in recording.frames))


def truth_with_the_real_part_first(recording: Recording) -> Recording:
    truth = recording.truth["camera"]
    w_first = np.roll(Rotation.from_matrix(truth.T_world_body[:, :3, :3]).as_quat(), 1, axis=1)
    T = truth.T_world_body.copy()
    T[:, :3, :3] = Rotation.from_quat(w_first).as_matrix()
    return replace(recording, truth={"camera": replace(truth, T_world_body=T)})


def inverted_truth(recording: Recording) -> Recording:
    truth = recording.truth["camera"]
    return replace(recording, truth={"camera": replace(truth, T_world_body=se3.inverses(truth.T_world_body))})


def body_in_millimetres(recording: Recording) -> Recording:
    T = recording.truth["camera"].of_body(se3.exp(np.array([0.05, -0.04, 0.1, 0.3, -0.35, 0.25]))).T_world_body.copy()
    T[:, :3, 3] *= 1000.0
    return replace(recording, truth={"rig": replace(recording.truth["camera"], T_world_body=T)})


FAULTS = [
    (unspoiled, set()),
    (depth_shifted, {"depth registration"}),
    (depth_late, {"depth time"}),
    (half_missing, {"colour frames", "depth frames"}),
    (every_second_missing, {"colour frames", "depth frames"}),
    (focal_wrong, {"focal length"}),
    (both_focals_wrong, {"focal length"}),
    (scale_wrong, {"depth scale"}),
    (truth_with_the_real_part_first, {"truth"}),
    (inverted_truth, {"truth"}),
    (body_in_millimetres, {"truth"}),
]
RARE = (
    half_missing,
    every_second_missing,
    both_focals_wrong,
    truth_with_the_real_part_first,
    inverted_truth,
    body_in_millimetres,
)
"""Variants that the real recording is enough for."""


def bad(findings):
    return {finding.key for finding in findings if finding.verdict is Verdict.BAD}


def look(spec: str) -> Recording:
    options = SourceOptions()
    source = open_source(spec, options)
    try:
        return collect(source.messages(), options.topics, SECONDS, lambda done: None)
    finally:
        source.close()


@pytest.fixture(scope="module")
def fr1_xyz(shared_data) -> Recording:
    return look(str(shared_data / "tum_fr1_xyz"))


@pytest.fixture(scope="module")
def arena() -> Recording:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sensors.arena.source.frame", drawn.frame)
        return look("arena")


@pytest.mark.rendered
@pytest.mark.usefixtures("followed_once")
@pytest.mark.parametrize(
    ("source", "fault", "expected"),
    [
        (source, *case)
        for source in ("fr1_xyz", "arena")
        for case in FAULTS
        if source == "fr1_xyz" or case[0] not in RARE
    ],
    ids=lambda value: ", ".join(sorted(value)) if isinstance(value, set) else getattr(value, "__name__", value),
)
def test_each_fault_is_named_and_only_that_one(request, source, fault, expected):
    findings = examine(fault(request.getfixturevalue(source)))
    assert bad(findings) == expected, "\n".join(f"{f.verdict.value}: {f.key}: {f.value}" for f in findings)
    assert all(finding.advice for finding in findings if finding.verdict is Verdict.BAD)
    if not expected:
        assert all(finding.verdict is Verdict.GOOD for finding in findings), findings


def test_nothing_is_good_about_an_empty_source():
    empty = np.zeros(0, dtype=np.int64)
    assert {"colour frames", "depth frames"} <= bad(examine(Recording(empty, empty, (), None, {})))


def test_a_still_camera_is_not_judged_where_motion_is_needed():
    rng = np.random.default_rng(0)
    image = cv2.GaussianBlur(rng.integers(0, 255, (240, 320), dtype=np.uint8), (0, 0), 3)
    stamps = np.arange(60, dtype=np.int64) * 33_333_333
    frames = tuple(
        RgbdFrame(
            k, stamp, image + rng.integers(0, 3, image.shape, dtype=np.uint8), stamp,
            np.rint(rng.normal(1500, 3, image.shape)).astype(np.uint16),
        )
        for k, stamp in enumerate(stamps)
    )  # fmt: skip
    from odom.frame import Camera

    truth = {"camera": Trajectory(stamps, np.tile(np.eye(4), (60, 1, 1)))}
    found = examine(Recording(stamps, stamps, frames, Camera(320, 240, 262.5, 262.5, 159.5, 119.5), truth))
    verdicts = {finding.key: finding.verdict for finding in found}
    for key in ("depth registration", "depth time", "focal length", "depth scale"):
        assert verdicts[key] is Verdict.UNKNOWN, (key, found)


def test_missing_frames_are_counted_by_the_sensors_own_period():
    rng = np.random.default_rng(1)
    stamps = np.round((np.arange(600) / 30 + rng.normal(0, 0.0015, 600)) * 1e9).astype(np.int64)
    kept = np.sort(rng.permutation(600)[:450])
    found = rhythm(stamps[kept])
    assert found.period_s == pytest.approx(1 / 30, rel=0.03)
    assert found.missing == pytest.approx(0.25, abs=0.03)
    assert judge_rhythm("colour", stamps).verdict is Verdict.GOOD


def test_a_slow_stream_may_be_one_of_stamps_in_another_unit() -> None:
    stamps = np.arange(60) * 33 * 10**9 // 30  # milliseconds taken for numbers of frames
    assert "the stamps are in another unit: write them in seconds" in judge_rhythm("colour", stamps).advice


def run_doctor(folder: Path, *options: str) -> tuple[int, str, list[dict[str, str]]]:
    out = folder / "findings.json"
    command = [sys.executable, "-m", "odom", "doctor", str(folder), "--seconds", "5", "--json", str(out), *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=250, env=os.environ, check=False)
    return done.returncode, done.stdout, json.loads(out.read_text()) if out.is_file() else []


def bad_checks(findings: list[dict[str, str]]) -> set[str]:
    """The faults of the recording: that the computer is too slow beside other tests is none."""
    return {f["check"] for f in findings if f["verdict"] == "BAD"} - {"speed"}


@pytest.fixture
def folder(shared_data, tmp_path) -> Path:
    """The first seconds of fr1_xyz as a folder of its own, whose lists and calibration a test may spoil."""
    source = shared_data / "tum_fr1_xyz"
    for name in ("rgb", "depth"):
        (tmp_path / name).symlink_to(source / name)
    for name in ("rgb.txt", "depth.txt", "groundtruth.txt", "camera.yaml"):
        (tmp_path / name).write_text((source / name).read_text())
    return tmp_path


@pytest.mark.long
def test_the_command_exits_with_0_on_a_good_folder(folder):
    status, text, findings = run_doctor(folder)
    assert bad_checks(findings) == set()
    is_quick = all(f["verdict"] != "BAD" for f in findings)  # a crowded computer's speed is told as well
    assert status == (0 if is_quick else 1)
    assert ("nothing would spoil" in text) == is_quick


@pytest.mark.long
def test_the_command_exits_with_1_and_names_stamps_60_ms_apart(folder):
    lines = (folder / "depth.txt").read_text().splitlines()
    moved = [
        line if line.startswith("#") else f"{float(line.split()[0]) + 0.06:.6f} {line.split()[1]}" for line in lines
    ]
    (folder / "depth.txt").write_text("\n".join(moved) + "\n")
    status, text, findings = run_doctor(folder)
    assert bad_checks(findings) == {"depth time"}
    assert status == 1
    assert "mend first: depth time" in text


@pytest.mark.long
def test_a_wrong_depth_scale_in_a_folders_calibration_is_named(folder):
    calibration = yaml.safe_load((folder / "camera.yaml").read_text())
    calibration["depth_scale"] = 5000.0 * 0.96
    (folder / "camera.yaml").write_text(yaml.safe_dump(calibration))
    assert bad(examine(look(str(folder)))) == {"depth scale"}


def test_topics_of_another_device_are_left_alone():
    assert collect([], Topics("cam7"), 1.0, lambda done: None).frames == ()
