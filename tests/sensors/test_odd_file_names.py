"""Names that the file system allows and text does not."""

import os
from pathlib import Path

import numpy as np
from refused import process_as_it_was
from test_tum import FRAMES, write_folder

from odom.cli.import_ import import_
from odom.service.mask_file import read_mask, write_mask
from odom.service.unlogged import unlogged
from odom.wire.recording import RecordingReader
from sensors.source import SourceOptions
from sensors.tum import open_tum

NO_UTF8 = os.fsdecode(b"caf\xe9")
"""OpenCV ends the process that gives it such a name of a file."""


def test_a_folder_whose_name_is_no_utf8_is_imported(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "tum").rename(tmp_path / NO_UTF8)
    with process_as_it_was(), unlogged():
        import_(str(folder), tmp_path / "a.mcap")
    topics = [message.topic for message in RecordingReader(tmp_path / "a.mcap").messages()]
    assert topics.count("cam0/color/image_raw/compressed") == FRAMES


def test_an_image_that_is_none_in_a_folder_whose_name_is_no_utf8_is_left_out(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "tum").rename(tmp_path / NO_UTF8)
    (folder / "rgb" / "1.jpg").write_text("no image")
    source = open_tum(folder, SourceOptions())
    with unlogged():  # words with such a name cannot be sent from one process of pytest's to another
        assert list(source.messages())
    assert source.refused == {("colour", "damaged file"): 1}


def test_a_mask_may_have_a_name_that_is_no_utf8(tmp_path: Path) -> None:
    mask = np.zeros((48, 64), dtype=bool)
    mask[:9] = True
    write_mask(tmp_path / f"{NO_UTF8}.png", mask)
    np.testing.assert_array_equal(read_mask(tmp_path / f"{NO_UTF8}.png"), mask)
