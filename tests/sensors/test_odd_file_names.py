"""Names that the file system allows and text does not."""

import os
from pathlib import Path

from refused import process_as_it_was
from test_tum import FRAMES, write_folder

from odom.cli.import_ import import_
from odom.wire.recording import RecordingReader


def test_a_folder_whose_name_is_no_utf8_is_imported(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "tum").rename(tmp_path / os.fsdecode(b"caf\xe9"))
    with process_as_it_was():
        import_(str(folder), tmp_path / "a.mcap")
    topics = [message.topic for message in RecordingReader(tmp_path / "a.mcap").messages()]
    assert topics.count("cam0/color/image_raw/compressed") == FRAMES
