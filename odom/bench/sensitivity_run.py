"""One run of the sensitivity bench: a program that is given changed tuned numbers, and prints one verdict a task.

Nothing of the algorithms is imported before the change is in place. It reads one JSON argument and writes one line a
task, `[number of the task, verdict]`, as soon as it is known, so that a crash loses no earlier one.
"""

import json
import sys
from dataclasses import asdict
from importlib import import_module

from odom.errors import OdomError
from odom.geometry.tuning import OVERRIDES


def main(argument: str) -> None:
    """Do all `tasks` of the robustness bench with `overrides` in place; what fails is a verdict that says so."""
    given = json.loads(argument)
    put_in_place(given["overrides"])

    from odom.bench.robustness_run import Task, outcome

    for number, task in enumerate(given["tasks"]):
        print(json.dumps([number, asdict(outcome(Task(**task)))]), flush=True)


def put_in_place(overrides: dict[str, float]) -> None:
    """Change tuned numbers before their packages read them; raises OdomError when one is read already, or unknown."""
    OVERRIDES.update(overrides)
    for key, value in overrides.items():
        package, _, name = key.rpartition(".")
        if getattr(import_module(f"odom.{package}.tuning").TUNING, name, None) != value:
            raise OdomError(f"{key} cannot be changed: it was read before, or there is no such number")


if __name__ == "__main__":
    main(sys.argv[1])
