"""The columns of a table of poses, by the names in its first line: EuRoC, pandas, OpenVINS, `rostopic echo -p`.

`#timestamp [ns], p_RS_R_x [m], .., q_RS_w [], q_RS_x [], ..` says that stamps are nanoseconds and w comes first.
"""

import re
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation

from odom.frame.stamp import is_number

_WANTED = ("stamp", "x", "y", "z", "qx", "qy", "qz", "qw")
"""The columns of a pose, in TUM's order."""
_STAMPS = ("stamp", "timestamp", "timestamps", "time", "ts", "t")
"""What the last word of a stamp's column may be; a message's own `stamp` is taken before the time it was written."""
_FINER = {"s": 0, "sec": 0, "seconds": 0, "ms": 3, "us": 6, "ns": 9, "nsec": 9, "nanoseconds": 9}
"""Units in names of stamps' columns, and how many digits finer than a second they are."""
_POSITION = re.compile(r"(p|t|pos|position|trans|translation)([xyz]?)")
_QUATERNION = re.compile(r"(q|quat\w*?|orient\w*?|rot\w*?)([xyzw]?)")
_LEAST_KNOWN = 3
"""Columns that are known by their names from which on a line is taken for one of names."""


@dataclass(frozen=True)
class PoseColumns:
    """Where a table has stamp, x, y, z, qx, qy, qz, qw (`places`), and how many digits finer than seconds it counts."""

    line: int
    places: tuple[int, ...]
    finer: int

    def pick(self, line: str) -> list[str]:
        """Return the eight fields of a pose from those of a line, its stamp in seconds; raises ValueError."""
        fields = _fields(line)
        if len(fields) <= max(self.places):
            raise ValueError(f"{len(fields)} fields")
        picked = [fields[place] for place in self.places]
        try:
            seconds = Decimal(picked[0]).scaleb(-self.finer)
        except InvalidOperation:
            raise ValueError(f"{picked[0]!r} is no time") from None
        return [str(seconds), *picked[1:]]


def pose_columns(text: str) -> PoseColumns | None:
    """Return the columns that a text names before its first line of numbers, None where it names none.

    Raises ValueError where a line names some of a pose's columns, but not all, or one twice.
    """
    for number, line in enumerate(text.splitlines(), 1):
        words = line.strip(" \t,;")
        if not words:
            continue
        if is_number(re.split(r"[\s,;]", words)[0]):
            return None
        names = _fields(re.sub(r"\s*[\[(](.*?)[\])]", _unit_behind, line.lstrip("#% \t")))
        found = _places(names)
        missing = [name for name in _WANTED if name not in found]
        twice = [name for name, places in found.items() if len(places) > 1]
        is_usual_order = not missing and [found[name][0] for name in _WANTED] == list(range(len(names)))
        # a comment may be prose, or name TUM's columns: they are taken without it, with stamps by their digits
        if words.startswith("#") and (missing or twice or is_usual_order):
            continue
        if len(found) < _LEAST_KNOWN:
            return None
        if missing or twice:
            what = f"none for {' '.join(missing)}" if missing else f"several for {' '.join(twice)}"
            raise ValueError(f"it names columns, but {what}: name them timestamp,x,y,z,qx,qy,qz,qw")
        places = tuple(found[name][0] for name in _WANTED)
        return PoseColumns(number, places, _FINER.get(_words(names[places[0]])[-1], 0))
    return None


def _fields(line: str) -> list[str]:
    """Return the fields of a line that are parted by commas, semicolons or, without any, blanks; `#` ends it."""
    text = line.split("#", 1)[0].replace(";", ",")
    return [field.strip() for field in text.split(",")] if "," in text else text.split()


def _places(names: list[str]) -> dict[str, list[int]]:
    """Return the places of the columns of a pose among `names`."""
    found: dict[str, list[int]] = {}
    for place, name in enumerate(names):
        if column := _column(_words(name)):
            found.setdefault(column, []).append(place)
    stamps = found.pop("time", [])
    if stamps and "stamp" not in found:
        found["stamp"] = stamps[:1]
    return found


def _column(words: list[str]) -> str | None:
    """Return which column of a pose is called so: `stamp`, `time`, one of `_WANTED`, None for another."""
    if len(words) > 1 and words[-1] in _FINER:
        words = words[:-1]
    if not words:
        return None
    last, axis = words[-1], words[-1][-1]
    if last in _STAMPS:
        return "stamp" if last == "stamp" else "time"
    if words == [axis] and axis in "xyz":
        return axis
    for pattern, before in ((_QUATERNION, "q"), (_POSITION, "")):
        matches = [found for word in words if (found := pattern.fullmatch(word))]
        if matches and axis in "xyzw" and (last == axis or any(m[0] == last and m[2] for m in matches)):
            return before + axis if before + axis in _WANTED else None
    return None


def _words(name: str) -> list[str]:
    return [word for word in re.split(r"[^a-z0-9]+", name.lower()) if word]


def _unit_behind(found: re.Match[str]) -> str:
    """Return `_ns` of ` [ns]`, nothing of any other unit: a stamp is in none of these."""
    unit = found[1].strip().lower()
    return f"_{unit}" if unit in _FINER else ""
