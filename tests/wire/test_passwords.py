"""Files of users and passwords: what is wrong with one is said before anybody is refused for it."""

from pathlib import Path
from typing import Any

import pytest

from odom.errors import ConfigError
from odom.wire.security import SecuritySettings, security_configuration

SECRET = "fish-and-chips"


def users(tmp_path: Path, content: bytes) -> dict[str, Any]:
    (tmp_path / "users").write_bytes(content)
    return security_configuration(SecuritySettings(users_file=tmp_path / "users"))


def password(tmp_path: Path, content: bytes) -> object:
    (tmp_path / "password").write_bytes(content)
    settings = SecuritySettings(user="viewer", password_file=tmp_path / "password")
    return security_configuration(settings)["transport/auth/usrpwd/password"]


@pytest.mark.parametrize(
    ("line", "wrong"), [(SECRET, "no colon"), (f": {SECRET}", "no user"), (f"{SECRET}: ", "no password")]
)
def test_a_wrong_line_of_the_users_file_is_named_but_not_shown(tmp_path: Path, line: str, wrong: str) -> None:
    with pytest.raises(ConfigError, match=rf"users, line 3: {wrong}; write user:password") as refused:
        users(tmp_path, f"viewer:{SECRET}\n\n{line}\nrecorder:{SECRET}\n".encode())
    assert SECRET not in str(refused.value)


@pytest.mark.parametrize("content", [b"", b"\n", b" \r\n\r\n"])
def test_a_users_file_without_users_is_refused(tmp_path: Path, content: bytes) -> None:
    with pytest.raises(ConfigError, match="holds no users, so all would be refused: write a line user:password"):
        users(tmp_path, content)


@pytest.mark.parametrize("content", [f"viewer:{SECRET}", f" viewer : {SECRET}:\r\n\r\nm\u00fcller:gr\u00fcn\n"])
def test_a_sound_users_file_is_handed_to_zenoh(tmp_path: Path, content: str) -> None:
    found = users(tmp_path, content.encode())
    assert found == {"transport/auth/usrpwd/dictionary_file": str((tmp_path / "users").resolve())}


@pytest.mark.parametrize("encoding", ["latin-1", "utf-16", "utf-16-le"])
@pytest.mark.parametrize("read", [users, password])
def test_another_encoding_is_refused_with_what_to_do(tmp_path: Path, read: Any, encoding: str) -> None:
    with pytest.raises(ConfigError, match=r"(users|password) is no text in UTF-8: save it in that encoding"):
        read(tmp_path, "viewer:gr\u00fcn\n".encode(encoding))


def test_a_byte_order_mark_is_no_part_of_a_password(tmp_path: Path) -> None:
    assert password(tmp_path, SECRET.encode("utf-8-sig")) == SECRET


def test_a_byte_order_mark_would_be_part_of_a_users_name(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="begins with a byte order mark"):
        users(tmp_path, f"viewer:{SECRET}".encode("utf-8-sig"))


def test_blanks_around_a_password_are_left_out_as_in_the_users_file(tmp_path: Path) -> None:
    assert password(tmp_path, f"  {SECRET} \r\nnot this".encode()) == SECRET
    with pytest.raises(ConfigError, match="holds no password in its first line"):
        password(tmp_path, f" \n{SECRET}".encode())
