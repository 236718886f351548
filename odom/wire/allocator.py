"""The memory of a process that only passes large messages on."""

import ctypes

_M_MMAP_THRESHOLD = -3
"""The setting's number in glibc's malloc.h."""
_LARGE_BYTES = 128 << 10
"""Size from which a freed block goes back to the system at once: glibc's own threshold at the start of a process.
Larger: holes stay in memory, with which a recorder grew by some 15 MB an hour; smaller: more page faults."""


def give_back_large_blocks() -> None:
    """Let the C library give blocks of 128 kB and more back to the system as soon as they are freed.

    Otherwise glibc keeps them once it has seen such a block freed, and images of varying sizes leave holes. It costs a
    page fault for each 4 kB of a message, so it is not for a process that computes. A C library without such a setting
    is left alone.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, _LARGE_BYTES)
