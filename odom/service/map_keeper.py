"""The map of a run on disk, if there is one: opened for a camera, and written in the background."""

import logging
from pathlib import Path

from odom.backend import Odometry
from odom.backend.map.saved import SavedMap
from odom.frame import Camera, Stamp
from odom.map_file.map_file import MapFile

_LOG = logging.getLogger(__name__)
_PERIOD_S = 0.5
"""Period by the frames' stamps in which changes are taken: a crash loses no more than this and the time to copy
them."""


class MapKeeper:
    """Keeps the map of an odometry in `path`; does nothing where there is none. With `localize` it is only read.

    Raises ConfigError for what is no map, MapError where it is damaged or in use.
    """

    def __init__(self, path: Path | None, localize: bool = False) -> None:
        self._file = None if path is None else MapFile(path, is_written=not localize)
        self._taken = Stamp(0)

    def begin(self, camera: Camera, odometry: Odometry | None) -> SavedMap | None:
        """Return the map for a camera, after the changes by the `odometry` before were written.

        Raises MapError where the map was made with another camera.
        """
        if odometry is not None:
            self.save(odometry)
        return None if self._file is None else self._file.begin(camera)

    def note(self, odometry: Odometry, stamp: Stamp) -> None:
        """Hand on what has changed by the frame of this `stamp`, if it is time."""
        if self._file is not None and not 0 <= (stamp - self._taken) * 1e-9 < _PERIOD_S:
            self._taken = stamp
            self.hand_on(odometry)

    def hand_on(self, odometry: Odometry) -> None:
        """Hand on what has changed."""
        changes = odometry.take_map_changes()
        if self._file is not None and not changes.is_empty:
            self._file.put(changes)

    def save(self, odometry: Odometry) -> None:
        """Write what has changed, and wait for it."""
        if self._file is not None:
            self.hand_on(odometry)
            self._file.flush()

    @property
    def unwritten(self) -> int:
        """Changes that are not on disk since they could not be written: 0 once they are."""
        return 0 if self._file is None else self._file.unwritten

    @property
    def has_map(self) -> bool:
        """Whether there is a map on disk."""
        return self._file is not None

    def report(self) -> dict[str, object]:
        """Return what report.json says of the map, nothing without one."""
        if self._file is None:
            return {}
        return {"map": {"file": str(self._file.path), "localize": not self._file.is_written, "lost": self._file.lost}}

    def close(self) -> None:
        """Write what waits, and close the file; safe to call twice."""
        if self._file is not None:
            self._file.close()
            self._file = None
