"""Named arrays and numbers as compressed bytes with a checksum, and back: no bytes can make them run or err silently.

    crc32 (4 bytes, little-endian, of all that follows) | zstd( length of header (4 bytes) | header | arrays )

The header is JSON: of each array its name, type and shape, in the order in which they follow.
"""

import json
import struct
import zlib
from collections.abc import Mapping
from math import prod
from typing import Any

import numpy as np
import zstandard
from numpy.typing import NDArray

from odom.errors import MapError

_TYPES = ("<f8", "<f4", "<i8", "<i4", "<u4", "|u1")
_NUMBER = struct.Struct("<I")
_LEVEL = 3
"""Compression level of zstd, its default. Larger: slower, with hardly smaller files."""
_MOST_BYTES = 1 << 30
"""What a value may unpack to: a damaged length must not take all memory."""

Arrays = Mapping[str, NDArray[Any]]


class _Unpacked(dict[str, NDArray[Any]]):
    """Arrays by name; one that is missing is an error of the map."""

    def __missing__(self, name: str) -> NDArray[Any]:
        raise MapError(f"not what was written: it holds no {name}")


def pack(arrays: Arrays) -> bytes:
    """Return the bytes of named arrays."""
    header = [[name, a.dtype.newbyteorder("<").str, list(a.shape)] for name, a in arrays.items()]
    text = json.dumps(header, separators=(",", ":")).encode()
    parts = [np.ascontiguousarray(a, dtype=a.dtype.newbyteorder("<")).tobytes() for a in arrays.values()]
    content = zstandard.ZstdCompressor(level=_LEVEL).compress(b"".join([_NUMBER.pack(len(text)), text, *parts]))
    return checked(content)


def unpack(content: bytes) -> dict[str, NDArray[Any]]:
    """Return the arrays that were packed, of which one that is not there raises MapError when it is asked for.

    Each has memory of its own and may be written, as those that are measured: loops would be compiled anew for others.
    Raises MapError for bytes that are not what was written.
    """
    try:
        packed = unchecked(content)
        if zstandard.frame_content_size(packed) > _MOST_BYTES:  # zstd takes as much memory as a value says it needs
            raise MapError("it says that it is larger than any value of a map")
        inside = zstandard.ZstdDecompressor().decompress(packed, max_output_size=_MOST_BYTES)
        (length,) = _NUMBER.unpack_from(inside)
        at = _NUMBER.size + length
        arrays = _Unpacked()
        for name, type_, shape in json.loads(inside[_NUMBER.size : at]):
            if type_ not in _TYPES:
                raise MapError(f"an array of type {type_}")
            count = prod(shape)
            arrays[name] = np.frombuffer(inside, type_, count, at).reshape(shape).copy()
            at += count * np.dtype(type_).itemsize
    except (zstandard.ZstdError, struct.error, ValueError, TypeError, MemoryError) as error:
        raise MapError(f"not what was written: {error}") from error
    return arrays


def checked(content: bytes) -> bytes:
    """Return bytes with their checksum before them."""
    return _NUMBER.pack(zlib.crc32(content)) + content


def unchecked(content: bytes) -> bytes:
    """Return bytes without the checksum before them; raises MapError where it is not theirs."""
    if not isinstance(content, bytes) or len(content) < _NUMBER.size:
        raise MapError("cut")
    inside = content[_NUMBER.size :]
    if _NUMBER.unpack_from(content)[0] != zlib.crc32(inside):
        raise MapError("not what was written: its checksum is wrong")
    return inside
