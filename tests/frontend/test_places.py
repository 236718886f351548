import tracemalloc

import numpy as np
import pytest
from painted_room import PaintedRoom, stroll
from sensor_models import sensor_model, view_of

from odom.frame import Camera
from odom.frontend.features.images import FrameImages
from odom.frontend.features.place_descriptor import Place, describe_place
from odom.frontend.matching.place_recognition import PlaceIndex, match_places
from odom.geometry import se3
from odom.registration.gated_registration import register

CAMERA = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
SENSOR = sensor_model(CAMERA)


def place_of(descriptors):
    n = len(descriptors)
    return Place(descriptors, np.zeros((n, 3)), np.tile(np.eye(3), (n, 1, 1)))


def seen_again(descriptors, rng, share_seen=0.5, bits_flipped=0.06):
    kept = descriptors[rng.random(len(descriptors)) < share_seen]
    noise = np.packbits(rng.random((len(kept), 256)) < bits_flipped, axis=1)
    others = rng.integers(0, 256, (len(descriptors) - len(kept), 32), dtype=np.uint8)
    return place_of(np.concatenate([kept ^ noise, others]))


@pytest.fixture(scope="module")
def hundreds():
    rng = np.random.default_rng(0)
    looks = rng.integers(0, 256, (400, 200, 32), dtype=np.uint8)
    index = PlaceIndex()
    for number, descriptors in enumerate(looks):
        index.adopt(index.grown({number: place_of(descriptors)}))
    return index, looks


def test_the_right_place_among_hundreds_comes_first(hundreds):
    index, looks = hundreds
    rng = np.random.default_rng(1)
    asked = range(0, 400, 7)
    right = [index.look_up(seen_again(looks[k], rng), set(), 3)[:1] == [k] for k in asked]
    assert np.mean(right) == 1.0


def test_an_excluded_place_is_not_returned(hundreds):
    index, looks = hundreds
    assert 5 not in index.look_up(place_of(looks[5]), {5}, 3)


@pytest.mark.parametrize("places", [200, 1000])
def test_a_look_up_costs_the_same_however_many_places_look_alike(places):
    rng = np.random.default_rng(2)
    looks = rng.integers(0, 256, (50, 32), dtype=np.uint8)
    index = PlaceIndex()
    for number in range(places):
        index.adopt(index.grown({number: place_of(looks)}))
    newest = index.look_up(place_of(looks), set(), 1000)
    assert sorted(newest) == list(range(places - 24, places))


def test_the_index_costs_less_than_50_kB_a_place_and_nothing_soon_after_it_is_forgotten():
    places = [place_of(look) for look in np.random.default_rng(3).integers(0, 256, (50, 700, 32), dtype=np.uint8)]

    def grown():
        index = PlaceIndex()
        for number, place in enumerate(places):
            index.adopt(index.grown({number: place}))
        return index

    grown()  # loads what it needs: that is not a place's
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    index = grown()
    cost = tracemalloc.get_traced_memory()[0] - before
    for number in range(len(places)):
        index.forget(number)
    index.adopt(index.grown({}))
    left = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert cost / len(places) < 50_000
    assert left < 50_000


def test_nothing_is_found_for_an_image_without_features(hundreds):
    index, looks = hundreds
    nothing = place_of(np.zeros((0, 32), np.uint8))
    assert index.look_up(nothing, set(), 3) == []
    assert match_places(nothing, place_of(looks[0])) is None


def described(room, T_room_camera):
    return describe_place(view_of(room.frame(CAMERA, 0, T_room_camera)), SENSOR, np.zeros(6))


@pytest.mark.parametrize("seed", range(3))
def test_a_place_seen_again_gives_the_motion_between_the_two_views(seed):
    room = PaintedRoom(seed)
    T_a = stroll(0.0)
    T_b = T_a @ se3.exp(np.array([0.15, -0.08, 0.2, 0.05, -0.15, 0.3]))
    pairs = match_places(described(room, T_b), described(room, T_a))
    assert pairs is not None
    registration = register(pairs)
    assert registration.ok
    away = se3.log(se3.inverse(se3.inverse(T_a) @ T_b) @ registration.T_target_source)
    assert np.linalg.norm(away[:3]) < 0.01
    assert np.rad2deg(np.linalg.norm(away[3:])) < 0.4


def test_two_different_rooms_do_not_agree_on_a_motion():
    a, b = described(PaintedRoom(1), stroll(0.0)), described(PaintedRoom(2), stroll(0.0))
    pairs = match_places(a, b)
    if pairs is not None:
        registration = register(pairs)
        assert not registration.ok or registration.inliers.sum() < 25


def test_a_black_image_describes_no_place():
    frame = PaintedRoom().frame(CAMERA, 0, stroll(0.0))
    black = FrameImages.of(np.zeros_like(frame.color))
    place = describe_place(view_of(frame, black), SENSOR, np.zeros(6))
    assert len(place.points) == len(place.descriptors) == 0


def test_a_feature_is_as_exact_as_the_caller_says():
    view = view_of(PaintedRoom().frame(CAMERA, 0, stroll(0.0)))
    exact, half, whole = (describe_place(view, SENSOR, np.zeros(6), px).covariances for px in (0.0, 0.5, 1.0))
    assert np.allclose(whole - exact, 4.0 * (half - exact))
    assert (np.trace(half - exact, axis1=1, axis2=2) > 0.0).all()
    assert np.array_equal(whole, describe_place(view, SENSOR, np.zeros(6)).covariances)


def test_a_place_can_be_described_by_what_is_around_some_points_alone_and_all_its_features_are_there():
    view = view_of(PaintedRoom().frame(CAMERA, 0, stroll(0.0)))
    points = np.array([[100.0, 120.0], [500.0, 300.0]])
    whole, part = (describe_place(view, SENSOR, np.zeros(6), around=around) for around in (None, points))
    uv = part.points[:, :2] / part.points[:, 2:] * 525.0 + (319.5, 239.5)
    away_px = np.linalg.norm(uv[:, None] - points, axis=2).min(axis=1)
    assert len(part.points) > 20
    assert away_px.max() < 26.0  # 24 px, and the pixels' own width
    seen = np.unique(whole.descriptors, axis=0)
    is_same = [(one == seen).all(axis=1).any() for one in part.descriptors]
    assert np.mean(is_same) < 1.0  # there are more features around them than among those of the whole
    assert len(describe_place(view, SENSOR, np.zeros(6), around=points[:0]).points) == 0
