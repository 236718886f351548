"""What the C library does with memory that a process no longer needs. One without these settings is left alone."""

import ctypes

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8
"""The settings' numbers in glibc's malloc.h."""
_LARGE_BYTES = 128 << 10
"""Size from which a freed block goes back to the system at once: glibc's own threshold at the start of a process.
Larger: holes stay in memory, with which a recorder grew by some 15 MB an hour; smaller: more page faults."""
_LARGER_THAN_IMAGES_BYTES = 2 << 20
"""The same where images of a VGA camera are kept to be written over: depth is 600 kB, colour 900."""
_ARENAS = 2
"""Pools that threads take small blocks from. glibc would make eight for each core, and none gives back to another."""


def give_back_large_blocks() -> None:
    """Let the C library give blocks of 128 kB and more back to the system as soon as they are freed.

    Otherwise glibc keeps them once it has seen such a block freed, and images of varying sizes leave holes. It costs a
    page fault for each 4 kB of a message, so it is not for a process that computes.
    """
    _set(_M_MMAP_THRESHOLD, _LARGE_BYTES)


def keep_little() -> None:
    """Let the C library give what is larger than an image back as soon as it is freed, and keep few pools of the rest.

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


def _set(setting: int, value: int) -> None:
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(setting, value)
