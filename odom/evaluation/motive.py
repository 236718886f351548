"""Rigid bodies from a CSV file that OptiTrack's Motive has exported.

One line of keys and values, then rows that name each column's type, body, and quantity (format 1.21: without labels),
then `Frame,Time (Seconds)` and the data, quaternions as x, y, z, w. Motive's world has y up; here z is up, as
everywhere else (REP-103). The times count from the start of the take, so the clock offset has to be estimated.
"""

import csv
from itertools import zip_longest
from pathlib import Path

import numpy as np

from odom.errors import SourceError
from odom.evaluation.files import trajectory_of
from odom.evaluation.trajectory import Trajectory
from odom.frame import from_seconds
from odom.geometry.arrays import Array

T_ZUP_YUP: Array = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""Turns a world with y up, as Motive exports it, into one with z up: x stays."""
_BODY = "Rigid Body"
_METRES = {"meters": 1.0, "centimeters": 0.01, "millimeters": 0.001}
_NEEDED = tuple(("Position", axis) for axis in "XYZ") + tuple(("Rotation", axis) for axis in "XYZW")


def is_motive(path: Path) -> bool:
    """Return whether a CSV file has one of the lines that every export of Motive has; raises SourceError."""
    return any(row[0].strip() in ("Frame", "Format Version") for row in _rows(path))


def read_motive(path: Path, body: str | None = None, y_up: bool = True) -> Trajectory:
    """Return the trajectory of a rigid body, in metres and with z up; frames in which it was not seen are left out.

    `body` may be left out when there is only one; `y_up=False` takes a file exported with z up as it is. Raises
    SourceError when the file is not such an export, or the body is missing or not the only one.
    """
    rows = _rows(path)
    start = next((i for i, row in enumerate(rows) if row[0].strip() == "Frame"), None)
    if start is None or start < 3:
        raise SourceError(f"{path} is no Motive export: no line begins with Frame,Time (Seconds)")
    header = {key.strip(): value.strip() for key, value in zip(rows[0][::2], rows[0][1::2], strict=False)}
    if header.get("Rotation Type", "Quaternion") != "Quaternion":
        raise SourceError(f"{path} holds {header['Rotation Type']} angles: export again with quaternions")
    unit = header.get("Length Units", "Meters").lower()
    if unit not in _METRES:
        raise SourceError(f"{path}: lengths in {unit!r}: export metres or millimetres")
    types, names = _types_and_names(path, rows[1:start])
    labels = (types, names, rows[start - 1], rows[start])
    columns = [tuple(field.strip() for field in column) for column in zip_longest(*labels, fillvalue="")]
    bodies = sorted({name for kind, name, _, _ in columns if kind == _BODY})
    if body is None and len(bodies) == 1:
        body = bodies[0]
    if body not in bodies:
        raise SourceError(f"{path} has the rigid bodies {', '.join(bodies) or 'none'}: name the one on the camera")
    needed = [(_BODY, body, quantity, axis) for quantity, axis in _NEEDED]
    if missing := [column for column in needed if column not in columns]:
        raise SourceError(f"{path}: rigid body {body} has no column {' '.join(missing[0][2:])}")
    where = [columns.index(column) for column in needed]
    stamps, values = [], []
    for number, row in enumerate(rows[start + 1 :], 1):
        fields = [row[k].strip() if k < len(row) else "" for k in where]
        if not all(fields):
            continue
        try:
            stamps.append(from_seconds(row[1]))
            values.append([float(field) for field in fields])
        except (ValueError, IndexError) as error:
            raise SourceError(f"{path}: data row {number} cannot be read ({error})") from error
    t_q = np.array(values).reshape(-1, 7) * np.repeat([_METRES[unit], 1.0], [3, 4])
    trajectory = trajectory_of(path, np.array(stamps, dtype=np.int64), t_q)
    return trajectory.moved(T_ZUP_YUP) if y_up else trajectory


def _types_and_names(path: Path, head: list[list[str]]) -> tuple[list[str], list[str]]:
    """Return the rows that say what each column is of; up to format 1.21 they have no label and come first."""
    labelled = {row[1].strip(): row for row in head if len(row) > 1}
    if "Type" in labelled and "Name" in labelled:
        return labelled["Type"], labelled["Name"]
    if len(head) < 2 or _BODY not in (field.strip() for field in head[0]):
        raise SourceError(f"{path} is no Motive export of rigid bodies: no row says which columns are of one")
    return head[0], head[1]


def _rows(path: Path) -> list[list[str]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            return [row for row in csv.reader(file) if any(field.strip() for field in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SourceError(f"{path} cannot be read: {error}") from error
