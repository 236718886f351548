"""The index of a map's places on disk: whole blocks, and what was not yet put into one."""

import sqlite3
import threading
from pathlib import Path

import numpy as np

from odom.errors import MapError
from odom.frontend.matching.place_block import MOST_PLACES, TABLES, PlaceBlock
from odom.map_file import records
from odom.map_file.arrays import pack, unpack
from odom.map_file.database import raising_map_errors, transaction


def load(db: sqlite3.Connection, lock: threading.Lock, path: Path) -> tuple[PlaceBlock, ...]:
    """Return the blocks of all places: those on disk, and one more of places that are in none."""
    with raising_map_errors(path), lock:
        return tuple(_read(db))


def extend(db: sqlite3.Connection) -> None:
    """Write the index of all places; what is there already stays as it is."""
    blocks = _read(db)
    with transaction(db):
        db.execute("DELETE FROM place_block")
        db.executemany("INSERT INTO place_block VALUES (?, ?)", ((int(b.numbers[0]), _bytes(b)) for b in blocks))


def _read(db: sqlite3.Connection) -> list[PlaceBlock]:
    blocks = []
    for (content,) in db.execute("SELECT content FROM place_block ORDER BY first"):
        try:
            blocks.append(_block(content))
        except MapError:  # it is made again from the places themselves
            continue
    known = {int(n) for block in blocks for n in block.numbers}
    fresh = [n for (n,) in db.execute("SELECT number FROM place ORDER BY number") if n not in known]
    for at in range(0, len(fresh), MOST_PLACES):
        blocks = _joined(blocks, _made(db, fresh[at : at + MOST_PLACES]))
    return blocks


def _made(db: sqlite3.Connection, numbers: list[int]) -> PlaceBlock:
    described = []
    for number in numbers:
        row = db.execute("SELECT content FROM place WHERE number = ?", (number,)).fetchone()
        try:
            described.append(records.place_of(number, row[0] if row else b"").descriptors)
        except MapError:  # nothing can be recognised by it
            described.append(np.zeros((0, 32), dtype=np.uint8))
    return PlaceBlock.of(numbers, described)


def _joined(blocks: list[PlaceBlock], new: PlaceBlock) -> list[PlaceBlock]:
    if blocks and len(blocks[-1].numbers) + len(new.numbers) <= MOST_PLACES and blocks[-1].numbers[-1] < new.numbers[0]:
        return [*blocks[:-1], blocks[-1].joined(new)]
    return [*blocks, new]


def _bytes(block: PlaceBlock) -> bytes:
    return pack({"numbers": block.numbers} | {f"table_{t}": table for t, table in enumerate(block.tables)})


def _block(content: bytes) -> PlaceBlock:
    arrays = unpack(content)
    return PlaceBlock(arrays["numbers"], tuple(arrays[f"table_{t}"] for t in range(TABLES)))
