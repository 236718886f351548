"""How numerical loops are compiled: on their first call, cached on disk, without the GIL.

numba notices when the file of a loop changes, but not when a file that the loop calls into does. So the compiled code
of a package is kept in a folder named after a hash of its sources and of those of the packages below it; elsewhere the
code of a folder of sources is, by a hash of those and of all of the packages. If nothing can be written beside this
file, the folder is in the user's cache or in a private temporary one.

Arithmetic is rounded as written (IEEE 754), without fused multiply-adds: the compiler would find other ones where it
inlines other calls, which depends on whether a loop was compiled or loaded, and a replay would differ in the last bits.
Where a function calls no other compiled one this cannot happen: its sums may be `vectorised`.
"""

import contextlib
import fcntl
import hashlib
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")  # it colours messages that nobody sees, too

import numba  # what is set above is read when it is imported
from numba.core import config, types
from numba.core.caching import FunctionCache

from odom.geometry import loaded_code

F = TypeVar("F", bound=Callable[..., Any])

_FLOORS = ("geometry", "registration", "frontend", "backend", "calibration")
"""The packages that hold compiled loops; each calls only those before it."""


def _digest(package: str, sources: Path | None = None) -> str:
    """Return a hash of the sources of a package and of those below it (of all of them for any other package).

    The files of the folder `sources` count, too.
    """
    state = hashlib.sha256()
    for beside in sorted(sources.glob("*.py")) if sources else ():
        state.update(beside.read_bytes())
    floors = _FLOORS[: _FLOORS.index(package) + 1] if package in _FLOORS else _FLOORS
    for floor in floors:
        for folder, inner, files in os.walk(Path(__file__).parents[1] / floor):
            inner[:] = sorted(set(inner) - {"__pycache__"})  # other processes make and delete folders there
            for source in sorted(name for name in files if name.endswith(".py")):
                state.update(Path(folder, source).read_bytes())
    return state.hexdigest()[:16]


def _places() -> Iterator[Path]:
    """Yield folders for compiled code, best first. It will be executed, so nobody else may be able to write there."""
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
def _cache_folder(package: str = "", sources: Path | None = None) -> str:
    """Return the first folder that can be written; code compiled from other sources of the package is deleted."""
    name = f"numba-{package}-{_digest(package, sources)}"
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


def _home(function: Callable[..., Any]) -> tuple[str, Path | None]:
    """Return the package of a function, and if that is not one of `_FLOORS` the folder of its sources.

    A script without a package has none: numba sees when its one file changes.
    """
    names = function.__module__.split(".")
    if len(names) > 1 and names[1] in _FLOORS:
        return names[1], None
    return ".".join(names[:-1]), Path(function.__code__.co_filename).parent if len(names) > 1 else None


def compiled_before() -> bool:
    """Return whether an earlier process has noted that all loops are compiled, of just these sources."""
    return _note().exists()


def note_all_compiled() -> None:
    """Tell later processes that all loops that a start needs are compiled."""
    with contextlib.suppress(OSError):  # the disk is full: they look for themselves
        _note().touch()


def _note() -> Path:
    return Path(_cache_folder()) / "all-compiled"


class _SharedCache(FunctionCache):
    """A cache of compiled code that several processes fill at the same time.

    Without a lock two of them may give the same file name to code for different types of arguments.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what was compiled for a signature, None if nothing was."""
        loaded_code.make_ready(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]  # numba gives no types

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save what was compiled for a signature, while no other process saves anything in this folder.

        The code runs all the same where that fails: the disk is full, or a newer version, installed meanwhile, has
        deleted the folder.
        """
        with contextlib.suppress(OSError), (Path(self.cache_path).parent / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]  # numba gives no types


def _without_literals(get_call_template: Callable[..., Any]) -> Callable[..., Any]:
    """Return how a call is typed without regard to constants: numba would compile a function anew for each of them."""
    unliteral: Callable[[Any], Any] = types.unliteral

    def template(args: Any, kws: Any) -> Any:
        named = {name: unliteral(each) for name, each in dict(kws).items()}
        return get_call_template(tuple(unliteral(each) for each in args), named)

    return template


def compiled(function: F) -> F:
    """Compile `function` on its first call: numba, cached, without the GIL, division by zero gives inf as in numpy.

    The cache is below NUMBA_CACHE_DIR if that is set.
    """
    return _compiled(function, fastmath=False)


def vectorised(function: F) -> F:
    """Compile a `function` that calls no other compiled one so that its sums are added up several terms at a time.

    The order of the terms, and so the rounding, is fixed when the function is compiled; it is the processor's.
    """
    return _compiled(function, fastmath={"reassoc", "contract", "nsz"})


def _compiled(function: F, fastmath: bool | set[str]) -> F:
    settings = vars(config)
    before = settings["CACHE_DIR"]
    settings["CACHE_DIR"] = _cache_folder(*_home(function))  # read when a function is decorated
    try:
        # no wrapper for callers in C, which nobody is: a tenth of the compilation
        options: dict[str, Any] = {
            "nogil": True,
            "error_model": "numpy",
            "fastmath": fastmath,
            "no_cfunc_wrapper": True,
        }
        jitted: Any = numba.njit(**options)(function)
        jitted._cache = _SharedCache(function)  # type: ignore[no-untyped-call]  # numba gives no types
        jitted.get_call_template = _without_literals(jitted.get_call_template)
    finally:
        settings["CACHE_DIR"] = before
    return cast(F, jitted)
