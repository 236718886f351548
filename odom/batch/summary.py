"""The table of a batch: the figures of each recording's report, and which became better or worse than a baseline's."""

import json
import os
import statistics
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from odom.batch.job import Job
from odom.errors import SourceError

FIGURES = (
    "frames", "tracked", "completeness", "parts", "keyframes", "loop_closures", "matched", "ate_m", "ate_online_m",
    "rpe_1s_m", "rpe_1s_deg", "nees_mean", "nees_inside_95",
)  # fmt: skip
"""What a replay always gives alike; times and memory are in each recording's own report.json."""
JUDGED = {"completeness": 1, "ate_m": -1, "rpe_1s_m": -1}
"""Figures by which a recording got better (1: by growing, -1: by shrinking) or worse."""
_SAME = 0.01
"""A smaller share of change counts as none. Smaller: rounding of another library's version is reported; larger: what
was worked for is not."""
DONE, MISSING = "done", "not done"

Row = dict[str, Any]


def rows_of(jobs: Sequence[Job], failures: Mapping[str, str], baseline: Sequence[Row]) -> list[Row]:
    """Return a row for each job: name, state, damage, change and figures, and the baseline's of the same content.

    `failures` says by the jobs' names why some have failed, `source_damage` what of a recording that is done was cut or
    damaged; figures that a report lacks are None.
    """
    before = {row["content"]: row for row in baseline}
    rows = []
    for job in jobs:
        report = _report(job.folder / "report.json") if job.is_done else {}
        state = DONE if job.is_done else (failures.get(job.name) or MISSING)
        old = before.get(job.content)
        damage = "; ".join(report.get("source_damage", ()))
        row: Row = {"name": _text(job.name), "state": _text(state), "source_damage": _text(damage), "change": ""}
        row |= {name: report.get(name) for name in FIGURES}
        if baseline:
            row["change"] = "new" if old is None else change_of(old, row)
            row |= {f"baseline_{name}": None if old is None else old.get(name) for name in JUDGED}
        rows.append(row | {"content": job.content, "key": job.key})
    return rows


def _text(name: str) -> str:
    """Return a text with the name of a file in it that may be no UTF-8, which no file of the table could hold."""
    return os.fsencode(name).decode(errors="replace")


def change_of(old: Row, new: Row) -> str:
    """Return `better`, `worse`, `mixed` or `same`; a recording that fails is worse than one that does not."""
    if (old["state"] == DONE) != (new["state"] == DONE):
        return "better" if new["state"] == DONE else "worse"
    directions = set()
    for name, good in JUDGED.items():
        before, now = old.get(name), new.get(name)
        if before is not None and now is not None and abs(now - before) > _SAME * abs(before):
            directions.add("better" if (now - before) * good > 0 else "worse")
    return directions.pop() if len(directions) == 1 else ("mixed" if directions else "same")


def _report(path: Path) -> Row:
    try:
        report: Row = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise SourceError(f"{path} cannot be read: {error}; remove its folder to have it made again") from error
    return {**report, "parts": len(report.get("segments", ()))}


def totals_of(rows: Sequence[Row]) -> dict[str, Any]:
    """Return how many recordings are done, damaged, and changed and how, and the medians of the judged figures."""
    totals: dict[str, Any] = {"recordings": len(rows), "done": sum(row["state"] == DONE for row in rows)}
    totals["damaged"] = sum(bool(row["source_damage"]) for row in rows)
    for word in ("better", "worse", "mixed", "same", "new"):
        if any(row["change"] for row in rows):
            totals[word] = sum(row["change"] == word for row in rows)
    for name in JUDGED:
        values = [row[name] for row in rows if row[name] is not None]
        totals[f"median_{name}"] = statistics.median(values) if values else None
    return totals
