"""How numerical loops are compiled: on their first call, cached on disk, without the GIL.

numba notices a change of the file that a loop stands in, not of the files it calls; so the loops of a package are kept
in a folder named after its contents and those of the packages below. Where the installation is not writable, that
folder is in the user's cache or a private temporary one.

Arithmetic is rounded as written (IEEE 754), without fused multiply-adds: which ones the compiler finds depends on what
it has inlined, and that on whether a loop was compiled or loaded. A replay would not equal the first run to the bit.
"""

import ctypes
import hashlib
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import config

F = TypeVar("F", bound=Callable[..., Any])

_FLOORS = ("registration", "frontend", "backend")
"""The packages that hold compiled loops, each calling those before it."""
_MADV_DONTNEED = 4


def _digest(package: str) -> str:
    """Return a name for the present contents of a package and those below it."""
    state = hashlib.sha256()
    floors = _FLOORS[: _FLOORS.index(package) + 1] if package in _FLOORS else _FLOORS
    for floor in floors:
        for source in sorted((Path(__file__).parents[1] / floor).glob("*.py")):
            state.update(source.read_bytes())
    return state.hexdigest()[:16]


def _places() -> Iterator[Path]:
    """Yield where compiled code may be kept, best first: cached code is executed, so nobody else may write there."""
    if "NUMBA_CACHE_DIR" in os.environ:
        yield Path(os.environ["NUMBA_CACHE_DIR"])
    yield Path(__file__).parent / "__pycache__"
    yield Path.home() / ".cache" / "odom"
    own = Path(tempfile.gettempdir()) / f"odom-{os.getuid()}"
    own.mkdir(mode=0o700, exist_ok=True)
    status = own.lstat()
    if stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o077:
        yield own
    yield Path(tempfile.mkdtemp(prefix="odom-"))


@cache
def _cache_folder(package: str = "") -> str:
    """Return the first folder that can be written, cleared of what belongs to other contents of the package."""
    name = f"numba-{package}-{_digest(package)}"
    for place in _places():
        try:
            (place / name).mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(place / name, os.W_OK):
            for other in place.glob(f"numba-{package}-*"):
                if other.name != name:
                    shutil.rmtree(other, ignore_errors=True)
            return str(place / name)
    raise AssertionError("a temporary folder was made, so one was returned")


def compiled(function: F) -> F:
    """Compile `function` on its first call (numba, cached, GIL released, division by zero gives inf, not an error).

    The cache is below NUMBA_CACHE_DIR where that is set.
    """
    settings = vars(config)
    before = settings["CACHE_DIR"]
    settings["CACHE_DIR"] = _cache_folder(*function.__module__.split(".")[1:2])  # read when a function is decorated
    try:
        jitted: Any = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    finally:
        settings["CACHE_DIR"] = before
    return cast(F, jitted)


def release_compiler() -> None:
    """Give the memory of the compiler's own code back to the system (some 50 MB), once loops are compiled or loaded.

    The pages are the library file's: should the compiler be needed again, the system reads them again. Does nothing
    where the system is not Linux.
    """
    if not sys.platform.startswith("linux"):
        return
    madvise = ctypes.CDLL(None, use_errno=True).madvise
    madvise.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
    for line in Path("/proc/self/maps").read_text().splitlines():
        addresses, access, *_, name = line.split()
        if access == "r-xp" and "libllvmlite" in name:
            begin, end = (int(address, 16) for address in addresses.split("-"))
            madvise(begin, end - begin, _MADV_DONTNEED)
