import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from painted_room import SMALL, PaintedRoom, stroll

from odom.frontend.features.corners import detect_corners

IMAGE = PaintedRoom().render(SMALL, stroll(0.0))[0]


@settings(max_examples=50)
@given(st.integers(0, 1000), st.integers(0, 150), st.integers(10, 60))
def test_corners_keep_to_free_squares_off_the_border_and_away_from_features(seed, count, cell):
    occupied = np.random.default_rng(seed).uniform((0, 0), (320, 240), (count, 2))
    corners = detect_corners(IMAGE, occupied, cell)
    squares = set(map(tuple, corners // cell))
    assert len(squares) == len(corners)
    assert squares.isdisjoint(map(tuple, occupied // cell))
    assert (corners >= 14).all()
    assert (corners < (320 - 14, 240 - 14)).all()
    if count and len(corners):
        assert np.abs(corners[:, None] - np.floor(occupied)[None]).max(axis=2).min() > 10


def test_corners_are_spread_over_the_image():
    corners = detect_corners(IMAGE, np.zeros((0, 2)), 22)
    counts = np.histogram2d(*corners.T, bins=(4, 3), range=((0, 320), (0, 240)))[0]
    assert (counts >= 3).all()


def test_an_image_without_texture_has_no_corners():
    assert len(detect_corners(np.full((240, 320), 80, np.uint8), np.zeros((0, 2)), 22)) == 0


def test_the_best_corner_of_a_square_is_taken():
    image = np.full((240, 320), 60, np.uint8)
    image[100:110, 100:110] = 90
    image[120:130, 120:130] = 250
    corners = detect_corners(image, np.zeros((0, 2)), 300)
    assert len(corners) == 1
    assert np.abs(corners[0] - 124.5).max() < 7
