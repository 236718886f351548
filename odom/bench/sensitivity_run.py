"""One run of the sensitivity bench: a program that is given changed tuned numbers, and prints one outcome per source.

Nothing of the algorithms is imported before the change is in place. It reads one JSON argument and writes one line per
source, `[source, outcome]`, as soon as it is known, so that a crash loses no earlier one.
"""

import json
import logging
import sys
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from odom.errors import OdomError
from odom.evaluation.sensitivity import Outcome
from odom.geometry.tuning import OVERRIDES

if TYPE_CHECKING:
    from odom.backend import OdometrySettings
    from sensors.source import Source, SourceOptions


def main(argument: str) -> None:
    """Run the odometry with `overrides` over every source of `runs`; a failing one is an outcome that says so."""
    task = json.loads(argument)
    put_in_place(task["overrides"])
    logging.disable()

    from odom.service.settings import load_settings
    from sensors.catalogue import open_source
    from sensors.source import SourceOptions

    runs = task["runs"]
    settings = load_settings(runs["config"] and Path(runs["config"])).odometry
    camera, seconds = runs["camera"] and Path(runs["camera"]), runs["seconds"]
    for source in runs["sources"]:
        options = SourceOptions(camera=camera, end=seconds)
        try:
            outcome = run(open_source(source, options), options, settings)
        except Exception as error:  # any failure is the outcome of this value
            outcome = Outcome(error=f"{type(error).__name__}: {error}")
        print(json.dumps([source, asdict(outcome)]), flush=True)


def put_in_place(overrides: dict[str, float]) -> None:
    """Change tuned numbers before their packages read them; raises OdomError when one is read already, or unknown."""
    OVERRIDES.update(overrides)
    for key, value in overrides.items():
        package, _, name = key.rpartition(".")
        if getattr(import_module(f"odom.{package}.tuning").TUNING, name, None) != value:
            raise OdomError(f"{key} cannot be changed: it was read before, or there is no such number")


def run(source: "Source", options: "SourceOptions", settings: "OdometrySettings") -> Outcome:
    """Run the odometry over a source and judge it against its truth as `odom run` does."""
    from odom.evaluation.relative import RelativePoses
    from odom.evaluation.run_report import ate_and_nees
    from odom.service.replayed import replay

    found = replay(source, options.topics, settings)
    poses, frames = len(found.trajectory), len(found.estimates)
    if not found.truth:
        return Outcome(poses=poses, frames=frames, error="no truth")
    body, truth = next(iter(found.truth.items()))
    seconds = ((estimate.stamp, estimate.second) for estimate in found.estimates if estimate.second)
    ate_m, nees = ate_and_nees(found.trajectory, RelativePoses.of(seconds), truth, body)
    return Outcome(ate_m, nees, poses, frames)


if __name__ == "__main__":
    main(sys.argv[1])
