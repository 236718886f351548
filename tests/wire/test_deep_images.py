"""Images of more than 8 bits a sample, as of infrared cameras, are seen by the bits that they use."""

import numpy as np
import pytest
from made_up_messages import mono16, plain_png

from odom.frame import Stamp
from odom.wire.codec import decode_color
from odom.wire.codec.deep_images import in_eight_bits
from odom.wire.codec.image_messages import decode_color_small

STAMP = Stamp(1)
GREY = np.random.default_rng(5).integers(0, 256, (120, 160)).astype(np.uint8)


def of_bits(bits: int) -> np.ndarray:
    return GREY.astype(np.uint16) << (bits - 8)


@pytest.mark.parametrize("bits", range(8, 17))
def test_an_image_is_the_same_whatever_bits_its_sensor_has(bits):
    deep = of_bits(bits)
    for big in (0, 1):
        np.testing.assert_array_equal(decode_color(mono16("color", STAMP, deep, big)), GREY)
    np.testing.assert_array_equal(decode_color(plain_png("color", STAMP, deep), grey=True), GREY)
    np.testing.assert_array_equal(decode_color(plain_png("color", STAMP, deep)), np.dstack([GREY] * 3))
    np.testing.assert_array_equal(decode_color_small(plain_png("color", STAMP, deep), 160), np.dstack([GREY] * 3))
    np.testing.assert_array_equal(decode_color(plain_png("color", STAMP, np.dstack([deep] * 3))), np.dstack([GREY] * 3))


def test_a_reflex_leaves_the_rest_as_bright_as_it_is():
    deep = of_bits(10)
    deep[0, :100] = 65535
    found = in_eight_bits(deep)
    np.testing.assert_array_equal(found[1:], GREY[1:])
    assert (found[0, :100] == 255).all()


@pytest.mark.parametrize(
    "image", [np.zeros((8, 8), np.uint16), np.full((2, 2), 65535, np.uint16), np.arange(256)[None]]
)
def test_what_needs_no_more_than_8_bits_stays(image):
    np.testing.assert_array_equal(in_eight_bits(image.astype(np.uint16)), np.minimum(image, 255))
