"""The compiled reader of depth files reads what OpenCV reads, and refuses what is damaged."""

import struct
import zlib
from itertools import pairwise

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from odom.errors import WireError
from odom.wire.codec.png_depth import decode_depth_png, is_depth_png

WIDTH, HEIGHT = 23, 37


def png(rows: bytes, form: tuple[int, ...] = (16, 0, 0, 0, 0), parts: int = 3) -> NDArray[np.uint8]:
    """A PNG of filtered rows, its data in some chunks, with a comment before them."""
    data = zlib.compress(rows)
    cuts = [len(data) * k // parts for k in range(parts + 1)]
    chunks = [(b"IHDR", struct.pack(">II5B", WIDTH, HEIGHT, *form)), (b"tEXt", b"Comment\0depth")]
    chunks += [(b"IDAT", data[a:b]) for a, b in pairwise(cuts)]
    body = b"".join(
        struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
        for kind, content in [*chunks, (b"IEND", b"")]
    )
    return np.frombuffer(b"\x89PNG\r\n\x1a\n" + body, dtype=np.uint8)


def filtered(seed: int) -> bytes:
    """Rows of any bytes, each with another of the five filters: any bytes are some image."""
    rng = np.random.default_rng(seed)
    rows = rng.integers(0, 256, (HEIGHT, 1 + 2 * WIDTH), dtype=np.uint8)
    rows[:, 0] = rng.integers(0, 5, HEIGHT)
    return rows.tobytes()


@given(st.integers(0, 10**6))
def test_every_filter_is_undone_as_by_libpng(seed: int) -> None:
    file = png(filtered(seed))
    assert is_depth_png(file)
    values = decode_depth_png(file)
    assert np.array_equal(values, cv2.imdecode(file, cv2.IMREAD_UNCHANGED))
    table = np.random.default_rng(seed).integers(0, 65536, 65536).astype(np.uint16)
    assert np.array_equal(decode_depth_png(file, table), table[values])


def test_what_opencv_writes_is_read() -> None:
    depth = np.random.default_rng(1).integers(0, 65536, (48, 64)).astype(np.uint16)
    _, file = cv2.imencode(".png", depth)
    assert np.array_equal(decode_depth_png(file), depth)


@pytest.mark.parametrize("form", [(8, 0, 0, 0, 0), (16, 2, 0, 0, 0), (16, 0, 0, 0, 1)])
def test_other_kinds_of_png_are_left_to_opencv(form: tuple[int, ...]) -> None:
    assert not is_depth_png(png(filtered(1), form))


@given(st.integers(0, 10**6), st.integers(1, 255))
def test_a_file_with_any_flipped_byte_is_refused_or_left_to_opencv(where: int, flip: int) -> None:
    file = png(filtered(1)).copy()
    file[where % file.size] ^= flip
    if is_depth_png(file):
        with pytest.raises(WireError):
            decode_depth_png(file)


@given(st.integers(0, 10**6))
def test_a_cut_file_is_refused_or_left_to_opencv(length: int) -> None:
    file = png(filtered(1))
    cut = file[: length % file.size]
    if is_depth_png(cut):
        with pytest.raises(WireError):
            decode_depth_png(cut)


@pytest.mark.parametrize("rows", [filtered(1)[:-1], filtered(1) + b"\0", b"\5" + filtered(1)[1:], b""])
def test_rows_that_do_not_fit_the_image_are_refused(rows: bytes) -> None:
    with pytest.raises(WireError):
        decode_depth_png(png(rows))
