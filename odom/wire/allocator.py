"""Returns freed memory to the system. A system or C library without these settings is left alone."""

import ctypes
from collections.abc import Iterator
from pathlib import Path

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8
"""The settings' numbers in glibc's malloc.h."""
_MADV_DONTNEED = 4
"""The advice's number in Linux's mman.h."""
_LARGE_BYTES = 128 << 10
"""Size from which a freed block goes back to the system at once: glibc's own threshold at the start of a process.
Larger: holes stay in memory, with which a recorder grew by some 15 MB an hour; smaller: more page faults."""
_LARGER_THAN_IMAGES_BYTES = 2 << 20
"""The same for a process that reuses the memory of VGA images: depth is 600 kB, colour 900."""
_ARENAS = 2
"""Pools from which threads take small blocks. glibc would make eight for each core, and none gives back to another."""


def give_back_large_blocks() -> None:
    """Let the C library give blocks of 128 kB and more back to the system as soon as they are freed.

    Otherwise glibc keeps them once it has seen such a block freed, and images of varying sizes leave holes. It costs a
    page fault for each 4 kB of a message, so it is not for a process that computes.
    """
    _set(_M_MMAP_THRESHOLD, _LARGE_BYTES)


def keep_little() -> None:
    """Let the C library return blocks larger than an image as soon as they are freed, and keep few pools of the rest.

    For a process that computes in several threads, before it starts the first one: its odometry then takes 37 MB less.
    """
    _set(_M_ARENA_MAX, _ARENAS)
    _set(_M_MMAP_THRESHOLD, _LARGER_THAN_IMAGES_BYTES)
    _set(_M_TRIM_THRESHOLD, 2 * _LARGER_THAN_IMAGES_BYTES)


def give_back_freed() -> None:
    """Give back to the system what was freed so far."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def give_back_code() -> None:
    """Drop library code from memory at the end of a start: most is not called again, least of all the compiler's.

    Code that is called again is loaded again from the system's cache of files. Code that was changed in memory stays.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    for begin, end in _unchanged_code():
        libc.madvise(ctypes.c_void_p(begin), ctypes.c_size_t(end - begin), _MADV_DONTNEED)


def _unchanged_code() -> Iterator[tuple[int, int]]:
    """Yield where files that may be executed, and not written, are mapped."""
    try:
        lines = Path("/proc/self/smaps").read_text().splitlines()
    except OSError:
        return
    span: list[str] = []
    for line in lines:
        words = line.split()
        if not words[0].endswith(":"):  # address, rights, offset, device, inode, path
            span = words[0].split("-") if words[1] == "r-xp" and words[4] != "0" else []
        elif words[0] == "Private_Dirty:" and words[1] == "0" and span:
            yield int(span[0], 16), int(span[1], 16)


def _set(setting: int, value: int) -> None:
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(setting, value)
