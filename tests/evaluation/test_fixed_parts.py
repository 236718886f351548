"""What carries the camera is found by what of the image stays the same while it moves, and nothing else is."""

import numpy as np
import pytest
from carrier import carried, carrier_mask
from painted_room import SMALL, PaintedRoom, anchor_before_camera, stroll

from odom import read_recording
from odom.evaluation.diagnosis import Verdict
from odom.evaluation.diagnosis.fixed_parts import fixed_parts, judge_fixed_parts
from odom.evaluation.painter import Painter
from odom.evaluation.passers_by import passers_by
from odom.frontend.camera.lens import Lens

ROOM = PaintedRoom(seed=4)
WALK = [ROOM.frame(SMALL, 10 * number, stroll(number / 3)) for number in range(40)]


@pytest.mark.parametrize("share", [0.06, 0.25, 0.5])
@pytest.mark.parametrize("is_grey", [True, False])
def test_the_carrier_is_found_whole_and_little_more(share: float, is_grey: bool) -> None:
    images = [carried(frame, share).color for frame in WALK]
    found = fixed_parts(images if is_grey else [np.repeat(image[..., None], 3, axis=2) for image in images])
    true = carrier_mask(WALK[0], share)
    assert found.are_known
    assert found.mask.shape == true.shape
    assert not (true & ~found.mask).any()
    assert (found.mask & ~true).mean() < 0.08


def test_images_of_another_size_in_between_do_not_matter() -> None:
    images = [carried(frame, 0.25).color for frame in WALK]
    images[10:12] = [image[:200, :300] for image in images[10:12]]
    assert fixed_parts(images).share == pytest.approx(0.25, abs=0.08)


def test_nothing_of_a_scene_stays_the_same() -> None:
    found = fixed_parts([frame.color for frame in WALK])
    assert found.are_known
    assert found.share == 0.0


@pytest.mark.parametrize("name", ["tum_fr1_xyz", "tum_fr1_rpy_part", "hololens_part"])
def test_nothing_of_a_real_scene_stays_the_same(shared_data, name: str) -> None:
    found = fixed_parts([frame.color for frame in read_recording(shared_data / name, end=8.0)])
    assert found.are_known
    assert found.share == 0.0


@pytest.mark.parametrize("are_there_people", [False, True])
def test_a_camera_at_rest_tells_nothing(are_there_people: bool) -> None:
    frames = [ROOM.frame(SMALL, 3 * number, np.eye(4)) for number in range(60)]
    if are_there_people:
        bodies = passers_by(SMALL, 0.5, share=0.5)
        painter = Painter(SMALL, bodies, frames[0].stamp, anchor_before_camera, Lens.of(SMALL))
        frames = [painter.paint(frame)[0] for frame in frames]
    finding = judge_fixed_parts([frame.color for frame in frames])
    assert finding.verdict is Verdict.UNKNOWN
    assert "does not move enough" in finding.value


def test_a_carrier_is_bad_until_it_is_masked() -> None:
    images = [carried(frame, 0.3).color for frame in WALK]
    bad = judge_fixed_parts(images)
    assert bad.verdict is Verdict.BAD
    assert "odom mask" in bad.advice
    assert judge_fixed_parts(images, fixed_parts(images).mask).verdict is Verdict.GOOD
    assert judge_fixed_parts([frame.color for frame in WALK]).verdict is Verdict.GOOD


def rim(image: np.ndarray) -> np.ndarray:
    """The image as one is that was rectified: black where the camera saw nothing."""
    height, width = image.shape[:2]
    v, u = np.mgrid[:height, :width]
    return np.where(np.hypot(2 * u / width - 1, 2 * v / height - 1) > 1.2, 0, image).astype(np.uint8)


def test_the_black_rim_of_rectified_images_is_found_and_does_no_harm() -> None:
    images = [rim(frame.color) for frame in WALK]
    assert 0.0 < fixed_parts(images).share < 0.2
    assert judge_fixed_parts(images).verdict is Verdict.GOOD
