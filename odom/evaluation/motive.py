"""Rigid bodies from a CSV file that OptiTrack's Motive has exported.

One line of keys and values, then rows that name each column's type, body, and quantity, then `Frame,Time (Seconds)`
and the data, quaternions as x, y, z, w. Motive's world has y up; here z is up, as everywhere else (REP-103). The
times count from the start of the take, so the clock offset has to be estimated.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from odom.errors import SourceError
from odom.evaluation.files import nanoseconds, trajectory_of
from odom.evaluation.trajectory import Trajectory

Array = NDArray[np.float64]

T_ZUP_YUP: Array = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
_METRES = {"meters": 1.0, "centimeters": 0.01, "millimeters": 0.001}
_NEEDED = tuple(("Rotation", axis) for axis in "XYZW") + tuple(("Position", axis) for axis in "XYZ")


@dataclass(frozen=True)
class _Table:
    header: dict[str, str]
    types: list[str]
    names: list[str]
    quantities: list[str]
    axes: list[str]
    rows: list[list[str]]


def read_motive(path: Path, body: str | None = None, y_up: bool = True) -> Trajectory:
    """Return the trajectory of a rigid body, in metres and with z up; frames in which it was not seen are left out.

    `body` may be left out when there is only one; `y_up=False` takes a file exported with z up as it is. Raises
    SourceError when the file is not such an export, or the body is missing or not the only one.
    """
    table = _parse(path)
    if table.header.get("Rotation Type", "Quaternion") != "Quaternion":
        raise SourceError(f"{path} holds {table.header['Rotation Type']} angles: export again with quaternions")
    unit = table.header.get("Length Units", "Meters").lower()
    if unit not in _METRES:
        raise SourceError(f"{path}: lengths in {unit!r}: export metres or millimetres")
    bodies = sorted({n for t, n in zip(table.types, table.names, strict=True) if t == "Rigid Body"})
    if body is None and len(bodies) == 1:
        body = bodies[0]
    if body not in bodies:
        raise SourceError(f"{path} has the rigid bodies {', '.join(bodies) or 'none'}: name the one on the camera")
    columns = []
    for quantity, axis in _NEEDED:
        key = ("Rigid Body", body, quantity, axis)
        found = [k for k in range(len(table.axes)) if key == _column(table, k)]
        if not found:
            raise SourceError(f"{path}: rigid body {body} has no column {quantity} {axis}")
        columns.append(found[0])
    stamps, values = [], []
    for number, row in enumerate(table.rows, 1):
        fields = [row[k].strip() if k < len(row) else "" for k in columns]
        if not all(fields):
            continue
        try:
            stamps.append(nanoseconds(row[1]))
            values.append([float(field) for field in fields])
        except (ValueError, ArithmeticError, IndexError) as error:
            raise SourceError(f"{path}: data row {number} cannot be read ({error})") from error
    q_t = np.array(values).reshape(-1, 7)
    trajectory = trajectory_of(path, stamps, np.column_stack([q_t[:, 4:] * _METRES[unit], q_t[:, :4]]))
    return trajectory.moved(T_ZUP_YUP) if y_up else trajectory


def _column(table: _Table, k: int) -> tuple[str, str, str, str]:
    return table.types[k], table.names[k], table.quantities[k], table.axes[k]


def _parse(path: Path) -> _Table:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [row for row in csv.reader(file) if any(field.strip() for field in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SourceError(f"{path} cannot be read: {error}") from error
    start = next((i for i, row in enumerate(rows) if row[0].strip() == "Frame"), None)
    if start is None or start < 3:
        raise SourceError(f"{path} is no Motive export: no line begins with Frame,Time (Seconds)")
    width = len(rows[start])

    def labels(row: list[str]) -> list[str]:
        return [field.strip() for field in (row + [""] * width)[:width]]

    named = {row[1].strip(): labels(row) for row in rows[1:start] if len(row) > 1}
    if "Type" not in named or "Name" not in named:
        raise SourceError(f"{path} is no Motive export: its rows Type and Name are missing")
    header = {key.strip(): value.strip() for key, value in zip(rows[0][::2], rows[0][1::2], strict=False)}
    return _Table(header, named["Type"], named["Name"], labels(rows[start - 1]), labels(rows[start]), rows[start + 1 :])
