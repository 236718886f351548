"""The memory of a process that only passes large messages on."""

import ctypes

_M_MMAP_THRESHOLD, _LARGE = -3, 128 << 10


def give_back_large_blocks() -> None:
    """Let the C library give blocks of 128 kB and more back to the system as soon as they are freed.

    glibc keeps them once it has seen such a block freed, and images of ever other sizes leave holes between what stays:
    a recorder grew by some 15 MB an hour so. It costs a page fault for each 4 kB of a message, so it is not for a
    process that computes. A C library that has no such setting is left alone.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, _LARGE)
