"""People in the laboratory: how they move; colour, depth and mask agree about them; they can be left out."""

import numpy as np
import pytest

from odom.errors import ConfigError
from odom.geometry.se3 import apply
from sensors.arena import ArenaOptions, frame, moving_mask
from sensors.arena import frames as session
from sensors.arena.camera_path import Infinity, Rest, make_walk
from sensors.arena.figure import ANKLE, AT_REST, Bone, bones
from sensors.arena.people import MOST_PEOPLE, People
from sensors.arena.row_readout import READOUT_S
from sensors.arena.walkers import document, walker

HEIGHT_M = 1.75
EVERYONE = range(MOST_PEOPLE)


def way(number: int, seconds: np.ndarray) -> np.ndarray:
    walks = walker(number, HEIGHT_M)
    return np.array([walks.posture(t)[:2] for t in seconds])


def test_people_walk_as_people_do_and_come_back_to_where_they_began() -> None:
    for number in EVERYONE:
        round_s = document()["people"][number]["round_s"]
        t = np.arange(0, round_s, 0.02)
        at = way(number, t)
        speed = np.linalg.norm(np.diff(at, axis=0), axis=1) / 0.02
        assert speed.max() < 1.3
        assert np.median(speed[speed > 0.5]) > 0.7
        assert (speed < 0.02).mean() > 0.1
        assert np.abs(np.diff(speed)).max() / 0.02 < 4.0
        assert np.allclose(way(number, np.array([0.0, 3.3])), way(number, round_s + np.array([0.0, 3.3])))


def test_nobody_walks_into_the_camera_or_into_another() -> None:
    t = np.arange(0, 64, 0.1)
    ways = [way(number, t) for number in EVERYONE]
    camera = np.array([Infinity().T_world_camera(s)[:2, 3] for s in t])
    for number, at in enumerate(ways):
        assert np.linalg.norm(at - camera, axis=1).min() > 0.75
        for other in ways[:number]:
            assert np.linalg.norm(at - other, axis=1).min() > 0.3


def test_the_lower_foot_is_on_the_ground_and_slides_little() -> None:
    walks = walker(0, HEIGHT_M)
    feet = [Bone.LEFT_FOOT, Bone.RIGHT_FOOT]
    places = np.array([bones(HEIGHT_M, walks.posture(t))[feet, :3, 3] for t in np.arange(12.0, 14.0, 0.01)])
    assert np.abs(places[:, :, 2].min(axis=1) - ANKLE * HEIGHT_M).max() < 0.01
    lower = places[:, :, 2].argmin(axis=1)
    stays = lower[1:] == lower[:-1]
    steps = np.linalg.norm(np.diff(places[..., :2], axis=0), axis=2)[np.arange(len(stays)), lower[1:]] / 0.01
    assert np.median(steps[stays]) < 0.5


def test_limbs_keep_their_length_and_swing() -> None:
    walks = walker(0, HEIGHT_M)
    poses = np.array([bones(HEIGHT_M, walks.posture(t)) for t in np.arange(11.0, 14.0, 0.02)])
    for near, far in ((Bone.LEFT_THIGH, Bone.LEFT_SHIN), (Bone.RIGHT_UPPER_ARM, Bone.RIGHT_FOREARM)):
        length = np.linalg.norm(poses[:, near, :3, 3] - poses[:, far, :3, 3], axis=1)
        assert np.ptp(length) < 1e-9
    turn = np.degrees(np.arccos(np.clip(poses[:, Bone.LEFT_THIGH, 2, 2], -1, 1)))
    assert turn.max() > 15
    assert np.allclose(np.linalg.det(poses[:, :, :3, :3]), 1)


def test_one_stands_for_five_seconds_and_leaves() -> None:
    t = np.arange(30.2, 35.0, 0.1)
    assert np.ptp(way(0, t), axis=0).max() < 0.06
    assert np.linalg.norm(way(0, np.array([36.4])) - way(0, np.array([35.0]))) > 0.5


def test_one_sits_down_and_gets_up_again() -> None:
    def hips(t: float) -> float:
        return float(bones(HEIGHT_M, walker(1, HEIGHT_M).posture(t))[Bone.PELVIS, 2, 3])

    standing = bones(HEIGHT_M, AT_REST)[Bone.PELVIS, 2, 3]
    assert hips(10.0) < 0.65 * standing
    assert min(hips(5.0), hips(17.0)) > 0.9 * standing


def test_one_carries_a_carton_away_and_brings_it_back() -> None:
    people = People.of(1, 3)
    (first, second) = (np.array(place[:3]) for place in document()["carton"])

    def at(t: float) -> np.ndarray:
        return people._carton(t)[0][:3, 3]

    assert np.allclose(at(1.0), first)
    assert np.allclose(at(27.0), second)
    assert np.allclose(at(64.0), first)
    carried = way(2, np.array([9.0]))[0]
    assert np.linalg.norm(at(9.0)[:2] - carried) < 0.6
    steps = np.linalg.norm(np.diff([at(t) for t in np.arange(0, 64, 0.05)], axis=0), axis=1)
    assert steps.max() < 0.12
    resting = [people.moving(t)[-1] for t in (1.0, 9.0, 27.0, 60.0)]
    assert resting == [False, True, False, True]


@pytest.mark.parametrize("index", [20, 130, 420])
def test_what_the_mask_shows_is_where_people_are(index: int) -> None:
    options = ArenaOptions(people=4, faults=False)
    shot, mask = frame(options, index), moving_mask(options, index)
    assert 0.1 < mask.mean() < 0.7
    t, camera = index / 30, options.camera
    v, u = np.nonzero(shot.depth_mm)
    z = shot.depth_mm[v, u] / 1000
    points = apply(
        shot.T_world_camera, np.column_stack([(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z])
    )
    near = np.min([np.linalg.norm(points[:, :2] - way(n, np.array([t])), axis=1) for n in EVERYONE], axis=0)
    shown = mask[v, u]
    assert (near[shown] < 0.8).mean() > 0.99
    body = (near < 0.16) & (points[:, 2] > 1.0) & (points[:, 2] < 1.5)
    assert body.sum() > 200
    assert shown[body].mean() > 0.99


def test_a_rolling_shutter_shears_who_walks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a camera at rest each row shows people where they were at the row's instant."""
    monkeypatch.setattr(session, "EXPOSURE_S", 0.0)
    rolled, perfect = ArenaOptions(people=4), ArenaOptions(people=4, faults=False)
    t, walk = 4.1, Rest(Infinity().T_world_camera(2.0))
    scene = session._scene("laboratory", 1, 4, False)

    def drawn(options: ArenaOptions, at: float) -> np.ndarray:
        return session.unpack(session._light(options, scene, walk, at)).mean(axis=2)

    picture, still = drawn(rolled, t), drawn(perfect, t)
    off_rolled, off_still = 0.0, 0.0
    for row in (10, 60, 420, 470):
        expected = drawn(perfect, t + (row / 480 - 0.5) * READOUT_S)[row]
        off_rolled += np.abs(picture[row] - expected).mean()
        off_still += np.abs(still[row] - expected).mean()
    assert off_still > 1.0
    assert off_rolled < 0.35 * off_still


def test_people_are_the_same_bytes_in_any_order() -> None:
    options = ArenaOptions(people=4)
    first = [frame(options, k) for k in (40, 300)]
    for shot in (frame(options, 300), frame(options, 40)):
        same = next(one for one in first if one.index == shot.index)
        assert shot.rgb.tobytes() == same.rgb.tobytes()
        assert shot.depth_mm.tobytes() == same.depth_mm.tobytes()


def test_equal_seeds_dress_people_equally_and_others_do_not() -> None:
    def picture(seed: int) -> np.ndarray:
        return np.concatenate([panel.paint().ravel() for panel in People.of(seed, 2).panels])

    assert np.array_equal(picture(1), picture(1))
    assert picture(1).shape != picture(2).shape or (picture(1) != picture(2)).any()


def test_the_camera_walks_the_same_way_with_people() -> None:
    walks = [make_walk(ArenaOptions(people=people)).T_world_camera(3.3) for people in (0, 4)]
    assert np.array_equal(*walks)


@pytest.mark.parametrize("texts", [{"people": "5"}, {"people": "-1"}, {"people": "1", "walk": "corridor"}])
def test_people_that_cannot_be_there_are_refused(texts: dict[str, str]) -> None:
    with pytest.raises(ConfigError, match="people"):
        ArenaOptions.from_texts(texts)
