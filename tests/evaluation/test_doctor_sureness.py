"""What the doctor once called bad, or was sure of, without reason: found by test_doctor_study.py."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from odom.evaluation.diagnosis import Verdict, examine
from odom.evaluation.diagnosis.depth import judge_noise
from odom.evaluation.diagnosis.intrinsics import judge_intrinsics
from odom.evaluation.diagnosis.motion import FocalFit
from odom.evaluation.diagnosis.stamps import judge_pairs
from odom.frame import Camera, RgbdFrame, Stamp
from odom.service.source_sample import collect
from sensors.catalogue import open_source
from sensors.source import SourceOptions

CAMERA = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)


def _frames(depth_m: np.ndarray, share: float) -> list[RgbdFrame]:
    """Depth images that scatter by this share of their depth, in steps of a millimetre."""
    rng = np.random.default_rng(0)
    color = np.zeros((480, 640), np.uint8)
    noisy = [1000 * depth_m * (1 + share * rng.standard_normal(depth_m.shape)) for _ in range(3)]
    return [RgbdFrame(i, Stamp(i), color, Stamp(i), np.rint(mm).astype(np.uint16)) for i, mm in enumerate(noisy)]


@pytest.mark.parametrize("seed", range(5))
def test_depth_images_that_are_lost_do_not_make_the_others_belong_to_other_colour(seed: int) -> None:
    rng = np.random.default_rng(seed)
    color = np.arange(180, dtype=np.int64) * 33_333_333
    kept = np.sort(rng.permutation(180)[:80])
    assert judge_pairs(color, color[kept] + 5_000_000, 80).verdict is Verdict.GOOD
    assert judge_pairs(color, color + 500_000_000 * 2, 0).verdict is Verdict.BAD


@pytest.mark.parametrize("share", [0.02, 0.03, 0.04])
def test_noise_is_not_taken_for_relief(share: float) -> None:
    wall = 2.4 + 0.001 * np.arange(640)[None, :].repeat(480, axis=0)
    assert judge_noise(_frames(wall, share)).verdict is Verdict.BAD
    assert judge_noise(_frames(wall, 0.002)).verdict is Verdict.GOOD


def test_relief_is_not_taken_for_noise() -> None:
    v, u = np.mgrid[:480, :640]
    bricks = 2.0 + 0.3 * ((u // 6 + v // 6) % 2)
    assert judge_noise(_frames(bricks, 0.002)).verdict is Verdict.UNKNOWN


def test_no_focal_length_is_given_by_a_wrong_centre() -> None:
    found = judge_intrinsics(replace(CAMERA, cx=180.0), FocalFit(np.ones(2) * 0.9, np.ones(2) * 0.02), True)
    assert found.verdict is Verdict.BAD
    assert "±" not in found.value
    assert "centre 180" in found.value


def test_a_focal_length_on_which_the_halves_of_a_recording_disagree_is_not_judged(shared_data: Path) -> None:
    options = SourceOptions(start=9.0)
    source = open_source(str(shared_data / "tum_fr1_xyz"), options)
    recording = collect(source.messages(), options.topics, 6.0, lambda done: None, True)
    verdicts = {finding.key: finding for finding in examine(recording)}
    assert verdicts["focal length"].verdict is not Verdict.BAD, verdicts["focal length"].value


@pytest.mark.parametrize(("factor", "size"), [(2.0, "1278 x 958"), (0.5, "319 x 240")])
def test_intrinsics_for_images_of_another_size_are_told_with_that_size(factor: float, size: str) -> None:
    other = {name: factor * getattr(CAMERA, name) for name in ("fx", "fy", "cx", "cy")}
    found = judge_intrinsics(replace(CAMERA, **other), None, True)
    assert found.verdict is Verdict.BAD
    assert f"for images of about {size} pixels" in found.advice
    assert f"divide fx, fy, cx and cy by {factor:g}" in found.advice
