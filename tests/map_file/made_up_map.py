"""Changes of a map that no camera has seen: quick to make, in the sizes that real ones have."""

import sqlite3
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

import numpy as np

from odom.backend.map.pose_graph import Edge
from odom.backend.map.saved import MapChanges, SavedDetails, SavedKeyframe, SavedLandmarks
from odom.frame import Camera, Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.features.measurement import Measurements
from odom.frontend.features.place_descriptor import Place
from odom.geometry import se3
from odom.map_file.map_file import MapFile

CAMERA = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
OWN = 20
"""Landmarks of a key frame."""


def keyframe(number: int) -> SavedKeyframe:
    T = se3.exp(np.array([0.1 * number, 0.0, 0.0, 0.0, 0.01 * number, 0.0]))
    links = (number - 1,) if number else ()
    return SavedKeyframe(number, 0, Stamp(10**9 * (1 + number)), 0, 0, T, np.eye(4), 1e-4 * np.eye(6), links)


def details(number: int, features: int = 60, day: int = 0) -> SavedDetails:
    rng = np.random.default_rng([day, number])
    identities = np.arange(OWN * number + 1, OWN * (number + 1) + 1)
    measured = Measurements(
        rng.normal(size=(OWN, 3)), rng.normal(size=(OWN, 3, 3)), rng.random((OWN, 4)), rng.normal(size=(OWN, 2))
    )
    patches = rng.integers(0, 256, (2, OWN, 25, 25), dtype=np.uint8)
    counts = np.ones(OWN, dtype=np.int64)
    covariance = np.tile(1e-4 * np.eye(3), (OWN, 1, 1))
    landmarks = SavedLandmarks(
        identities, rng.normal(size=(OWN, 3)), covariance, rng.random((OWN, 2)), rng.random((OWN, 3)), *patches,
        counts, counts, counts > 0,
    )  # fmt: skip
    place = Place(
        rng.integers(0, 256, (features, 32), dtype=np.uint8),
        rng.normal(size=(features, 3)),
        np.tile(1e-4 * np.eye(3), (features, 1, 1)),
    )
    return SavedDetails(ShutterTiming(0.02, 0.0, 0.01), identities, rng.random((OWN, 2)), measured, landmarks, place)


def changes(number: int, day: int = 0) -> MapChanges:
    """Key frame `number` as if it were new; what it shows is another thing each `day`."""
    edges = (Edge(number - 1, number, np.eye(4), 1e-4 * np.eye(6)),) if number else ()
    return MapChanges((keyframe(number),), edges, {number: details(number, day=day)}, OWN * (number + 1) + 1)


def make(path: Path, keyframes: int, day: int = 0) -> None:
    """Make a map of so many key frames."""
    opened = MapFile(path, is_written=True)
    opened.begin(CAMERA)
    for number in range(keyframes):
        opened.put(changes(number, day))
    opened.close()


def spoil(path: Path, table: str, where: str) -> None:
    """Flip a byte of a row, as a failing disk does."""
    with closing(sqlite3.connect(path)) as db, db:
        (content,) = db.execute(f"SELECT content FROM {table} WHERE {where}").fetchone()
        damaged = bytearray(content)
        damaged[len(damaged) // 2] ^= 0xFF
        db.execute(f"UPDATE {table} SET content = ? WHERE {where}", (bytes(damaged),))


class Counting:
    """Details of a map that note what is fetched."""

    def __init__(self, opened: MapFile) -> None:
        self._opened = opened
        self.fetched: list[int] = []

    def expect(self, numbers: Iterable[int]) -> None:
        """Read nothing ahead."""

    def fetch(self, number: int) -> SavedDetails | None:
        self.fetched.append(number)
        return self._opened.fetch(number)

    def fetch_place(self, number: int) -> Place | None:
        return self._opened.fetch_place(number)
