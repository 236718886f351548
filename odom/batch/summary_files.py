"""The table of a batch as files: JSON, CSV and a page."""

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path

from odom.batch.summary import Row, totals_of
from odom.errors import SourceError
from odom.service.result_files import whole_file

_SUMMARY = "summary.json"


def read_rows(folder: Path) -> list[Row]:
    """Return the rows of a batch's summary; raises SourceError when it has none."""
    path = folder / _SUMMARY
    try:
        rows = json.loads(path.read_text())["recordings"]
        if not all(isinstance(row, dict) and {"content", "state"} <= row.keys() for row in rows):
            raise ValueError("rows without content or state")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SourceError(f"{path} is no summary of `odom batch`: {error}") from error
    return list(rows)


def as_csv(rows: Sequence[Row]) -> str:
    """Return the table as CSV with a line of names; figures in full, None as nothing."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]) if rows else ["name"], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def write_summary(folder: Path, rows: Sequence[Row]) -> None:
    """Write summary.json, .csv and .html, each whole or as it was before; nothing when they hold these rows already."""
    names = {"json": folder / _SUMMARY, "csv": folder / "summary.csv", "html": folder / "summary.html"}
    content = json.dumps({"totals": totals_of(rows), "recordings": list(rows)}, indent=1) + "\n"
    table = as_csv(rows)
    if all(path.is_file() for path in names.values()):
        is_same = names["json"].read_bytes() == content.encode() and names["csv"].read_bytes() == table.encode()
        if is_same:
            return
    from odom.batch.page import page

    for path, text in ((names["html"], page(rows, totals_of(rows))), (names["csv"], table), (names["json"], content)):
        with whole_file(path) as file:
            file.write(text)
