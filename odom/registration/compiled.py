"""How numerical loops are compiled: on their first call, cached on disk, without the GIL.

numba notices a change of the file that a loop stands in, not of the files it calls; so the cache lies in a folder
named after the contents of all of them. Where the package is not writable, that folder is in the user's cache or a
private temporary one.
"""

import hashlib
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])


def _digest() -> str:
    """Return a name for the present contents of this package."""
    state = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        state.update(source.read_bytes())
    return state.hexdigest()[:16]


def _places() -> Iterator[Path]:
    """Yield where compiled code may be kept, best first: cached code is executed, so nobody else may write there."""
    yield Path(__file__).parent / "__pycache__"
    yield Path.home() / ".cache" / "odom"
    own = Path(tempfile.gettempdir()) / f"odom-{os.getuid()}"
    own.mkdir(mode=0o700, exist_ok=True)
    status = own.lstat()
    if stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o077:
        yield own
    yield Path(tempfile.mkdtemp(prefix="odom-"))


def _cache_folder() -> Path:
    """Return the first folder that can be written, cleared of what belongs to other contents."""
    name = f"numba-{_digest()}"
    for place in _places():
        try:
            (place / name).mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(place / name, os.W_OK):
            for other in place.glob("numba-*"):
                if other.name != name:
                    shutil.rmtree(other, ignore_errors=True)
            return place / name
    raise AssertionError("a temporary folder was made, so one was returned")


if "NUMBA_CACHE_DIR" not in os.environ:
    os.environ["NUMBA_CACHE_DIR"] = str(_cache_folder())

import numba  # noqa: E402  numba reads its cache folder when it is imported
from numba.core import config  # noqa: E402  same reason

vars(config)["CACHE_DIR"] = os.environ["NUMBA_CACHE_DIR"]  # someone else may have imported numba before


def compiled(function: F) -> F:
    """Compile `function` on its first call (numba, cached, GIL released, division by zero gives inf, not an error)."""
    jitted: Any = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})(function)
    return cast(F, jitted)
