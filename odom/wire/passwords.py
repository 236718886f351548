"""Files with passwords: the one that a process presents, and the users that a listening process lets in."""

import codecs
from pathlib import Path

from odom.errors import ConfigError


def first_line(file: Path) -> str:
    """Return the password in the first line; raises ConfigError when there is none."""
    password = _text(file.read_bytes().removeprefix(codecs.BOM_UTF8), file).partition("\n")[0].strip()
    if not password:
        raise ConfigError(f"{file} holds no password in its first line")
    return password


def check_users(file: Path) -> None:
    """Raise ConfigError unless each line is `user:password`, as Zenoh reads it, or blank; no message holds a line."""
    content = file.read_bytes()
    if content.startswith(codecs.BOM_UTF8):
        raise ConfigError(
            f"{file} begins with a byte order mark, which would belong to the first name: save it without"
        )
    lines = [line.strip() for line in _text(content, file).split("\n")]
    for number, line in enumerate(lines, 1):
        user, colon, password = map(str.strip, line.partition(":"))
        if line and not (user and password):
            wrong = "no colon" if not colon else "no password" if user else "no user"
            raise ConfigError(f"{file}, line {number}: {wrong}; write user:password, and nothing else in any line")
    if not any(lines):
        raise ConfigError(f"{file} holds no users, so all would be refused: write a line user:password for each")


def _text(content: bytes, file: Path) -> str:
    try:
        text = content.decode()
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise ConfigError(f"{file} is no text in UTF-8: save it in that encoding")
    return text
