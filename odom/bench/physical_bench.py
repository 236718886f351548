"""The processes behind `odom bench physical`: one for each simulated Kinect, or one for a recording."""

import os
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from odom.bench.bench_child import run_child
from odom.bench.physical_run import Part, Task
from odom.bench.physical_walk import check_length
from odom.errors import OdomError
from odom.evaluation.physical.judging import Outcome
from odom.evaluation.physical.table import PAPER_MM, Row, rows
from odom.evaluation.physical.wrong_pairs import Match, Spoilt, matches
from sensors.arena.options import ArenaOptions
from sensors.catalogue import open_source
from sensors.source import SourceOptions

SENSORS = ("kinect2", "kinect1")
"""The newer and the older Kinect, in the order of the paper's table."""
_CHECKED = ("Horn", "EM-ICP")
"""The estimators whose errors in the paper are to be explained by wrong pairs."""


@dataclass(frozen=True)
class Experiment:
    """Everything that was found, a table a sensor; `parts` are what the processes printed, by sensor."""

    source: str
    pairs: int
    seed: int
    rows: list[Row]
    closing: dict[str, list[Outcome]]
    spoilt: list[Spoilt]
    matches: list[Match]
    parts: dict[str, Part]
    wall_s: float
    cpu_s: float

    def as_json(self) -> dict[str, Any]:
        """Return it as lists and dictionaries; single outcomes are kept."""
        return {
            "source": self.source,
            "pairs": self.pairs,
            "seed": self.seed,
            "rows": [asdict(row) for row in self.rows],
            "closing": {name: [asdict(o) for o in outcomes] for name, outcomes in self.closing.items()},
            "wrong_pairs": [asdict(each) for each in self.spoilt],
            "paper_figures_at": [asdict(each) for each in self.matches],
            "notes": {name: part.notes for name, part in self.parts.items()},
            "ellipsoids": {name: part.ellipsoids for name, part in self.parts.items()},
            "outcomes": {name: part.outcomes for name, part in self.parts.items()},
            "wall_s": self.wall_s,
            "cpu_s": self.cpu_s,
        }


def check_source(source: str, camera: Path | None, pairs: int) -> None:
    """Raise ConfigError for a source that is live or has too few frames, SourceError for one that cannot be opened."""
    if source == "arena":  # drawn by its own process
        check_length(source, ArenaOptions().frames, pairs)
        return
    opened = open_source(source, SourceOptions(camera=camera))
    frames = opened.length if opened.lossless else None
    opened.close()
    check_length(source, frames, pairs)


def run_experiment(
    task: Task, jobs: int, progress: Callable[[int], None], stopped: Callable[[], bool] = lambda: False
) -> Experiment:
    """Run the experiment; `progress` is told per cent. Raises OdomError where a process fails, or when `stopped`."""
    begun, cpu_begun_s = time.monotonic(), sum(os.times()[:4])
    sensors = SENSORS if task.source == "arena" else ("",)
    folder = Path(task.folder)

    def look() -> bool:
        shares = [folder / f"progress-{name}" for name in sensors]
        progress(round(100 * sum(float(f.read_text() or 0) if f.is_file() else 0.0 for f in shares) / len(sensors)))
        return stopped()

    with ThreadPoolExecutor(jobs) as pool:
        tasks = [{**asdict(task), "sensor": name} for name in sensors]
        children = list(pool.map(lambda each: run_child("odom.bench.physical_run", each, None, look), tasks))
    if stopped():
        raise OdomError("interrupted: nothing was measured")
    parts = {}
    for name, child in zip(sensors, children, strict=True):
        part = Part(**child.values[0]) if child.values else Part(error=child.why)
        if part.error:
            raise OdomError(f"{task.source}: {part.error}")
        parts[name] = part
    table: list[Row] = []
    spoilt: list[Spoilt] = []
    found: list[Match] = []
    for name, part in parts.items():
        table += rows(name, [Outcome(**each) for each in part.outcomes], task.seed)
        mine = [Spoilt(**each) for each in part.spoilt]
        spoilt += mine
        found += matches(mine, PAPER_MM.get(name, PAPER_MM["kinect1"]), _CHECKED)
    closing = {name: _closing(part) for name, part in parts.items()}
    took_s = time.monotonic() - begun, sum(os.times()[:4]) - cpu_begun_s
    return Experiment(task.source, task.pairs, task.seed, table, closing, spoilt, found, parts, *took_s)


def _closing(part: Part) -> list[Outcome]:
    """Return the outcomes of the last cloud against the one before it, and against the first (number -1)."""
    last = max((each["number"] for each in part.outcomes), default=-1)
    return [Outcome(**each) for each in [*part.outcomes, *part.closing] if each["number"] in (last, -1)]
