"""A file or folder under a name of plain letters, for libraries that other names mislead."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory


@contextmanager
def named_plainly(path: Path, is_plain: bool) -> Iterator[Path]:
    """Yield `path` itself where it `is_plain`; else, for so long, a link to it of the same suffix."""
    if is_plain:
        yield path
        return
    with TemporaryDirectory(prefix="odom-") as folder:
        link = Path(folder) / f"plain{path.suffix if path.is_file() else ''}"
        link.symlink_to(path.absolute())
        yield link
