"""Frames drawn once, kept on disk: no test, no worker beside it and no later run draws the same view again.

They are kept below `ODOM_TEST_FRAMES` (conftest.py sets it), in a folder named after the contents of all that draws
them; at most 1 GiB, what goes beyond is drawn each time. Tests of the renderers themselves draw for themselves.
"""

import hashlib
import os
import shutil
from collections.abc import Callable
from dataclasses import astuple
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

ENVIRONMENT = "ODOM_TEST_FRAMES"
MOST_BYTES = 1 << 30

_ROOT = Path(__file__).parents[1]
_PAINTERS = ("sensors/arena", "odom/geometry", "odom/frame", "odom/frontend/camera", "tests/painted_room.py")

_PREFIX = "drawn-"
"""What the names of our own folders begin with: nothing else is ever removed."""

_IMAGES = ("rgb", "grey", "depth_mm")
"""Arrays that are kept as PNG, the others as they are."""

Arrays = dict[str, NDArray[Any]]


@cache
def _folder() -> Path | None:
    """Return where frames of the present sources are kept, those of other sources removed; None: nowhere."""
    place = os.environ.get(ENVIRONMENT)
    if not place:
        return None
    own = Path(place) / f"{_PREFIX}{_digest()}"
    own.mkdir(parents=True, exist_ok=True)
    for other in own.parent.glob(f"{_PREFIX}*"):
        if other != own:
            shutil.rmtree(other, ignore_errors=True)
    return own


def _digest() -> str:
    state = hashlib.sha256(" ".join(version(name) for name in ("numpy", "numba", "opencv-python-headless")).encode())
    for place in _PAINTERS:
        for source in sorted((_ROOT / place).rglob("*")) or [_ROOT / place]:
            if source.is_file() and "__pycache__" not in source.parts:
                state.update(source.read_bytes())
    return state.hexdigest()[:16]


_unseen: dict[Path, int] = {}
"""Of each folder, how many bytes this process may add before it looks again how much is there."""


def _has_room(folder: Path) -> bool:
    """Whether more may be kept. To count thousands of files takes as long as to draw one: this is done seldom."""
    if _unseen.get(folder, 0) <= 0:
        _unseen[folder] = (MOST_BYTES - sum(each.stat().st_size for each in folder.glob("*.npz"))) // 4
    return _unseen[folder] > 0


def kept(key: str, draw: Callable[[], Arrays]) -> Arrays:
    """Return the arrays that `key` names, drawn only when they are not kept yet; images among them are kept as PNG."""
    folder = _folder()
    if folder is None:
        return draw()
    file = folder / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.npz"
    if file.exists():
        with np.load(file) as stored:
            return {name: _decoded(stored[name]) if name in _IMAGES else stored[name] for name in stored}
    arrays = draw()
    if _has_room(folder):
        partial = file.with_suffix(f".{os.getpid()}.part")
        with partial.open("wb") as stream:
            np.savez(stream, **{n: _encoded(array) if n in _IMAGES else array for n, array in arrays.items()})
        _unseen[folder] -= partial.stat().st_size
        partial.replace(file)
    return arrays


def _encoded(image: NDArray[Any]) -> NDArray[Any]:
    done, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    assert done
    return np.asarray(data)


def _decoded(data: NDArray[Any]) -> NDArray[Any]:
    image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    assert image is not None
    return np.asarray(image)


def frame(options: Any, index: int) -> Any:
    """Return frame `index` of a simulated session, equal to the last bit to what `sensors.arena.frame` returns."""
    from sensors import arena

    names = ("stamp", "rgb", "depth_stamp", "depth_mm", "T_world_camera")

    def draw() -> Arrays:
        shot = arena.frame(options, index)
        return {name: np.asarray(getattr(shot, name)) for name in names}

    arrays = kept(f"{astuple(options)} {index}", draw)
    stamps = {name: int(arrays.pop(name)) for name in ("stamp", "depth_stamp")}
    return arena.ArenaFrame(index, **stamps, **arrays)
