"""Each fault is named by its own cause and remedy, not by what follows from it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from odom.cli.doctor import judge_odometry
from odom.evaluation.diagnosis import Recording, Verdict, examine
from odom.evaluation.diagnosis.depth import judge_valid
from odom.evaluation.diagnosis.depth_unit import steps_scale
from odom.evaluation.diagnosis.scale import ScaleFit, judge_scale
from odom.frame import RgbdFrame
from odom.service.source_sample import collect
from sensors.catalogue import open_source
from sensors.source import SourceOptions

SECONDS = 2.0


def look(folder: Path) -> Recording:
    options = SourceOptions()
    source = open_source(str(folder), options)
    recording = collect(source.messages(), options.topics, SECONDS, lambda done: None, is_recorded=True)
    return replace(recording, refused={**recording.refused, **source.refused})


@pytest.mark.parametrize(
    ("turned", "words"),
    [(np.s_[:, ::-1], "mirrored left to right"), (np.s_[::-1, ::-1], "turned by 180"), (np.s_[::-1], "top to bottom")],
)
def test_depth_that_is_turned_against_colour_is_named(good: Recording, turned: tuple[slice, ...], words: str) -> None:
    frames = tuple(replace(f, color=np.ascontiguousarray(f.color[turned])) for f in good.frames)
    (found,) = [f for f in examine(replace(good, frames=frames)) if f.verdict is Verdict.BAD]
    assert found.key == "depth orientation"
    assert words in found.value


def test_depth_five_times_too_large_shows_in_its_steps_though_the_nearest_were_rounded(good: Recording) -> None:
    large = [replace(f, depth_mm=f.depth_mm * np.uint16(5)) for f in good.paired[::4] if f.depth_mm.max() < 13_000]
    ratio = steps_scale(large)
    assert ratio is not None
    assert ratio == pytest.approx(5.0, rel=0.06)


def test_images_of_which_every_fifth_came_twice_are_named(good: Recording) -> None:
    shown = good.paired
    frames = tuple(replace(f, color=shown[i - (i % 5 == 4)].color) for i, f in enumerate(shown))
    (found,) = [f for f in examine(replace(good, frames=frames)) if f.verdict is Verdict.BAD]
    assert found.key == "colour images"
    assert f"{len(frames) // 5} of {len(frames) - 1} are the same as the one before" in found.value


@pytest.mark.parametrize("clip_mm", [800, 1200])
def test_depth_that_is_set_to_the_end_of_its_range_where_all_is_farther_is_named(good: Recording, clip_mm: int) -> None:
    frames = tuple(replace(f, depth_mm=np.minimum(f.depth_mm, np.uint16(clip_mm))) for f in good.paired)
    (found,) = [f for f in examine(replace(good, frames=frames)) if f.verdict is Verdict.BAD]
    assert found.key == "depth images"
    assert f"at {clip_mm} mm" in found.value


def test_the_largest_depth_is_no_measurement_to_any_check(good: Recording) -> None:
    frames = tuple(replace(f, depth_mm=np.where(f.depth_mm, f.depth_mm, 65535).astype(np.uint16)) for f in good.frames)
    assert examine(replace(good, frames=frames)) == examine(good)


@pytest.fixture(scope="module")
def good(shared_data) -> Recording:
    return look(shared_data / "tum_fr1_xyz")


@pytest.fixture
def folder(shared_data, tmp_path) -> Path:
    """The first two seconds of fr1_xyz as a folder of its own."""
    source = shared_data / "tum_fr1_xyz"
    for name in ("rgb", "depth"):
        (tmp_path / name).mkdir()
        lines = [line for line in (source / f"{name}.txt").read_text().splitlines() if not line.startswith("#")][:62]
        (tmp_path / f"{name}.txt").write_text("\n".join(lines) + "\n")
        for line in lines:
            (tmp_path / line.split()[1]).symlink_to(source / line.split()[1])
    (tmp_path / "camera.yaml").write_text((source / "camera.yaml").read_text())
    return tmp_path


def calibration(folder: Path, **values: object) -> None:
    file = folder / "camera.yaml"
    file.write_text(yaml.safe_dump({**yaml.safe_load(file.read_text()), **values}))


def each_depth(folder: Path, change: Callable[[np.ndarray], np.ndarray]) -> None:
    for file in (folder / "depth").iterdir():
        image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
        file.unlink()
        cv2.imwrite(str(file), change(image))


def ten_missing(folder: Path) -> None:
    for file in sorted((folder / "depth").iterdir())[5:55:5]:
        file.unlink()


def later(folder: Path, seconds: float) -> None:
    pairs = [line.split() for line in (folder / "depth.txt").read_text().splitlines()]
    (folder / "depth.txt").write_text("".join(f"{float(stamp) + seconds:.6f} {file}\n" for stamp, file in pairs))


SPOILT: dict[str, tuple[Callable[[Path], object], str, str]] = {
    "calibration of another size": (
        lambda folder: calibration(folder, image_width=320, image_height=240), "calibration size", "this image size",
    ),
    "depth of another size": (
        lambda folder: each_depth(folder, lambda image: image[:400, ::2].copy()), "depth size", "registered",
    ),
    "depth of 8 bits": (
        lambda folder: each_depth(folder, lambda image: (image >> 8).astype(np.uint8)), "depth images", "16-bit PNG",
    ),
    "ten depth files missing": (ten_missing, "depth images", "not there"),
    "stamps 100 s apart": (lambda folder: later(folder, 100.0), "pairs", "add -"),
}  # fmt: skip


@pytest.mark.parametrize("fault", SPOILT)
def test_a_spoilt_folder_is_named_by_its_cause_with_its_remedy(folder: Path, fault: str) -> None:
    spoil, key, remedy = SPOILT[fault]
    spoil(folder)
    recording = look(folder)
    bad = {finding.key: finding for finding in examine(recording) if finding.verdict is Verdict.BAD}
    assert set(bad) == {key}, [f"{finding.key}: {finding.value}" for finding in bad.values()]
    assert remedy in bad[key].advice


def stamped(folder: Path, stamp_of: Callable[[int, str], str]) -> None:
    for name in ("rgb", "depth"):
        pairs = [line.split() for line in (folder / f"{name}.txt").read_text().splitlines()]
        lines = [f"{stamp_of(k, stamp)} {file}\n" for k, (stamp, file) in enumerate(pairs)]
        (folder / f"{name}.txt").write_text("".join(lines))


@pytest.mark.parametrize(
    ("stamp_of", "words"),
    [
        (lambda k, stamp: "0.0", "all that came are stamped 0"),
        (lambda k, stamp: str(1_305_031_102 + k // 20), "have a stamp as of the one before"),
    ],
    ids=["0", "whole seconds"],
)
def test_stamps_that_do_not_advance_are_named_and_no_cable(
    folder: Path, stamp_of: Callable[[int, str], str], words: str
) -> None:
    stamped(folder, stamp_of)
    found = next(f for f in examine(look(folder)) if f.verdict is Verdict.BAD)
    assert found.key == "colour frames"
    assert words in found.value
    assert "do not advance" in found.advice
    assert "cable" not in found.advice


def test_a_first_image_stamped_0_hides_nothing_of_the_others(folder: Path) -> None:
    stamped(folder, lambda k, stamp: "0.0" if k < 2 else stamp)
    assert [f for f in examine(look(folder)) if f.verdict is Verdict.BAD] == []


def test_frames_are_counted_as_having_depth_only_when_they_have(folder: Path) -> None:
    ten_missing(folder)
    (pairs,) = [finding for finding in examine(look(folder)) if finding.key == "pairs"]
    color, paired = len(look(folder).color_stamps), len(look(folder).paired)
    assert paired <= color - 9
    assert pairs.value.startswith(f"{paired} of {color} colour frames have depth")


def changed(recording: Recording, change: Callable[[RgbdFrame], np.ndarray]) -> Recording:
    return replace(recording, frames=tuple(replace(frame, depth_mm=change(frame)) for frame in recording.frames))


def shifted(frame: RgbdFrame) -> np.ndarray:
    """Return the depth moved by 5.8 px, to the nearest pixel: right by 5, down by 3."""
    return np.roll(frame.depth_mm, (3, 5), axis=(0, 1))


CHANGED: dict[str, tuple[Callable[[Recording], Recording], str, str]] = {
    "depth five times too large": (
        lambda r: changed(r, lambda f: np.minimum(5 * f.depth_mm.astype(np.int64), 65535).astype(np.uint16)),
        "depth scale", "multiply depth by 0.",
    ),
    "depth in decimetres": (
        lambda r: changed(r, lambda f: (f.depth_mm // 100).astype(np.uint16)), "depth scale", "another unit",
    ),
    "depth constant": (
        lambda r: changed(r, lambda f: np.full_like(f.depth_mm, 1500)), "depth images", "test image",
    ),
    "depth stuck": (
        lambda r: changed(r, lambda f: r.frames[0].depth_mm), "depth images", "repeats",
    ),
    "wild distortion": (
        lambda r: replace(r, camera=replace(r.camera, distortion=(3.0, -9.0, 0.2, 0.3, 5.0))), "distortion", "k1 k2",
    ),
    "registration 5.8 px off": (lambda r: changed(r, shifted), "depth registration", "registered to colour"),
    "black images": (
        lambda r: replace(r, frames=tuple(replace(f, color=f.color // 64) for f in r.frames)), "exposure", "light",
    ),
}  # fmt: skip


@pytest.mark.usefixtures("followed_once")
@pytest.mark.parametrize("fault", CHANGED)
def test_a_fault_of_images_or_calibration_is_named_by_its_cause(good: Recording, fault: str) -> None:
    change, key, remedy = CHANGED[fault]
    findings = examine(change(good))
    bad = {finding.key: finding for finding in findings if finding.verdict is Verdict.BAD}
    assert set(bad) == {key}, [f"{finding.key}: {finding.value}" for finding in bad.values()]
    assert remedy in bad[key].advice
    assert not any("nan" in finding.value for finding in findings)


def test_two_good_seconds_are_called_good(good: Recording) -> None:
    assert {finding.verdict for finding in examine(good)} <= {Verdict.GOOD, Verdict.UNKNOWN}


@pytest.mark.parametrize("ratio", [1.0, 2.0, 5.0])
def test_the_steps_of_depth_tell_its_scale(good: Recording, ratio: float) -> None:
    frames = changed(good, lambda f: np.rint(f.depth_mm * ratio).astype(np.uint16)).frames[::4]
    assert steps_scale(frames) == pytest.approx(ratio, rel=0.06)


def test_the_odometrys_own_tracking_is_judged(good: Recording) -> None:
    levels, tracking, _ = judge_odometry(good.frames[:40], good.camera)
    assert "noise in use" in levels.value
    assert tracking.verdict is Verdict.GOOD
    assert "40 of 40 frames tracked" in tracking.value
    dark = tuple(replace(frame, color=np.zeros_like(frame.color)) for frame in good.frames[:40])
    _, tracking, _ = judge_odometry(dark, good.camera)
    assert tracking.verdict is Verdict.BAD
    assert "0 of 40" in tracking.value
    assert "lost: 40 by" in tracking.value


@pytest.mark.parametrize("ratio", [3.15e-16, -0.4, 1e9])
def test_a_ratio_that_says_nothing_gives_no_advice_to_multiply(ratio: float) -> None:
    found = judge_scale(ScaleFit(ratio, 0.3 * abs(ratio), 0.2), "camera")
    assert found.verdict is Verdict.UNKNOWN
    assert "multiply" not in found.advice


@pytest.mark.parametrize("every", [1, 4])
def test_depth_whose_pixels_lie_apart_is_enough(every: int) -> None:
    depth_mm = np.zeros((240, 320), dtype=np.uint16)
    depth_mm[3::every, 3::every] = 1500
    frame = RgbdFrame(sequence=0, stamp=0, color=np.zeros((240, 320), np.uint8), depth_stamp=0, depth_mm=depth_mm)
    found = judge_valid([frame])
    assert found.verdict is Verdict.GOOD
    assert "1.5 .. 1.5 m" in found.value
    assert ("6% are measured" in found.value) == (every > 1)
