"""A file that cannot be written is named, and room is asked for only where it is room that lacks."""

import errno
from pathlib import Path

import pytest

from odom.errors import OdomError, writing_to


def test_the_folders_above_a_file_are_made(tmp_path: Path) -> None:
    file = tmp_path / "new" / "folder" / "figures.json"
    with writing_to(file):
        file.write_text("1")
    assert file.read_text() == "1"


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EACCES, errno.EISDIR, errno.EROFS])
def test_room_is_asked_for_only_where_there_is_none(tmp_path: Path, number: int) -> None:
    with (
        pytest.raises(OdomError, match=r"a\.txt cannot be written: .*choose another place") as told,
        writing_to(tmp_path / "a.txt"),
    ):
        raise OSError(number, "why")
    assert ("make room" in str(told.value)) == (number in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG))


def test_a_folder_that_cannot_be_made_is_told_with_the_file(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(OdomError, match=r"file/a\.txt cannot be written"), writing_to(tmp_path / "file" / "a.txt"):
        pytest.fail("there is no such folder")
