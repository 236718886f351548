"""RVL, lossless run-length and variable-length coding of depth images (A. D. Wilson, 2017).

Runs of zeros and of non-zero values alternate. The length of a run, and the zigzag-coded difference of each value to
the previous non-zero one, are written in groups of three bits; the fourth bit says that more follow. Eight such nibbles
fill a little-endian 32-bit word from its top.
"""

import numpy as np
from numpy.typing import NDArray

from odom.errors import WireError
from odom.geometry.compiled import compiled


def encode_rvl(values: NDArray[np.uint16]) -> bytes:
    """Return the RVL stream of a flat array."""
    nibbles = np.empty(8 * values.size + 64, dtype=np.uint8)
    count = _encode(np.ascontiguousarray(values), nibbles)
    padded = np.zeros(-(-count // 8) * 8, dtype=np.uint8)
    padded[:count] = nibbles[:count]
    pairs = padded.reshape(-1, 4, 2)
    return ((pairs[:, ::-1, 0] << 4) | pairs[:, ::-1, 1]).astype(np.uint8).tobytes()


def decode_rvl(stream: NDArray[np.uint8], count: int) -> NDArray[np.uint16]:
    """Return the `count` values of an RVL stream; raises WireError when it is cut or does not fit `count`."""
    # a run of n zeros needs log8(n) nibbles and every other value at least one: no stream is shorter than one word
    words = np.frombuffer(stream[: stream.size // 4 * 4].tobytes(), dtype="<u4")
    out = np.zeros(count, dtype=np.uint16)
    if not _decode(words, out):
        raise WireError(f"RVL stream of {stream.size} bytes is cut or does not hold {count} values")
    return out


@compiled
def _put(nibbles: NDArray[np.uint8], at: int, value: int) -> int:
    while True:
        nibble = value & 7
        value >>= 3
        nibbles[at] = nibble | 8 if value else nibble
        at += 1
        if not value:
            return at


@compiled
def _encode(values: NDArray[np.uint16], nibbles: NDArray[np.uint8]) -> int:
    at, i, previous = 0, 0, 0
    while i < values.size:
        begin = i
        while i < values.size and values[i] == 0:
            i += 1
        at = _put(nibbles, at, i - begin)
        begin = i
        while i < values.size and values[i] != 0:
            i += 1
        at = _put(nibbles, at, i - begin)
        for j in range(begin, i):
            difference = int(values[j]) - previous
            at = _put(nibbles, at, (difference << 1) ^ (difference >> 63))
            previous = int(values[j])
    return at


@compiled
def _get(words: NDArray[np.uint32], at: int) -> tuple[int, int]:
    """Return (value, next nibble); the value is -1 after the end of the words or when it has more than 30 bits."""
    value, shift = 0, 0
    while at < 8 * words.size and shift < 30:
        nibble = (int(words[at >> 3]) >> (28 - 4 * (at & 7))) & 15
        at += 1
        value |= (nibble & 7) << shift
        shift += 3
        if nibble < 8:
            return value, at
    return -1, at


@compiled
def _decode(words: NDArray[np.uint32], out: NDArray[np.uint16]) -> bool:
    at, i, previous = 0, 0, 0
    while i < out.size:
        zeros, at = _get(words, at)
        if zeros < 0 or zeros > out.size - i:
            return False
        i += zeros
        values, at = _get(words, at)
        if values < 0 or values > out.size - i or (zeros == 0 and values == 0):
            return False
        for _ in range(values):
            zigzag, at = _get(words, at)
            if zigzag < 0:
                return False
            previous += (zigzag >> 1) ^ -(zigzag & 1)
            if previous < 0 or previous > 65535:
                return False
            out[i] = previous
            i += 1
    return True
