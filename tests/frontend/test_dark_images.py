"""Images taken in the dark: raised to contrast and smoothed, unless there is nothing but noise in them."""

from pathlib import Path

import numpy as np
import pytest
from painted_room import SMALL, PaintedRoom, stroll

from odom.backend import OdometrySettings, State
from odom.evaluation.robustness.color import darkness
from odom.evaluation.robustness.spoiler import Spoiler
from odom.frontend.features.images import noise_of, with_contrast
from odom.service.replayed import replay
from sensors.catalogue import open_source
from sensors.source import SourceOptions

RECORDING = Path(__file__).parents[2] / "recordings" / "arena.mcap"
ROOM = PaintedRoom()


def frame(k: int):
    return ROOM.frame(SMALL, k, stroll(k / 30.0))


def noisy(grey, sigma, seed=1):
    return np.clip(np.rint(grey + np.random.default_rng(seed).normal(0, sigma, grey.shape)), 0, 255).astype(np.uint8)


def test_an_image_with_contrast_stays_as_it_is():
    grey = frame(0).color
    assert with_contrast(grey) is grey


@pytest.mark.parametrize("sigma", [1.0, 2.0, 5.0])
def test_noise_is_told_from_texture(sigma):
    assert noise_of(noisy(100 + 0.2 * frame(0).color, sigma)) == pytest.approx(sigma, rel=0.15)


@pytest.mark.parametrize("light", [0.2, 0.1, 0.05])
def test_a_dark_image_becomes_like_the_one_in_the_light(light):
    lit = frame(0)
    raised = with_contrast(darkness(lit, light, 1).color)
    assert raised.std() > 25
    assert np.corrcoef(raised.ravel(), lit.color.ravel())[0, 1] > 0.95


def test_an_image_of_nothing_but_noise_stays_as_it_is():
    dark = darkness(frame(0), 0.0, 1).color
    assert with_contrast(dark) is dark
    even = np.full_like(dark, 40)
    assert with_contrast(even) is even


@pytest.mark.rendered
def test_the_camera_is_followed_in_the_dark():
    options = SourceOptions(end=3.0)
    spoiler = Spoiler(frame=lambda lit: darkness(lit, 0.06, 1))
    found = replay(open_source(str(RECORDING), options), options.topics, OdometrySettings(), spoiler)
    assert [estimate.state for estimate in found.estimates].count(State.TRACKING) >= 0.9 * len(found.estimates)
