"""What a process loads at its start, and what it leaves to those who need it: imports take seconds of a run."""

import resource
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from odom.service.evaluation_imports import EvaluationImports

HEAVY = (
    "numpy",
    "pydantic",
    "cv2",
    "zenoh",
    "numba",
    "scipy",
    "matplotlib",
    "gtsam",
    "rerun",
    "psutil",
    "mcap",
    "rich",
)


def loaded(code: str) -> set[str]:
    """The heavy packages that a fresh interpreter has loaded after some lines of code."""
    told = f"import sys\n{code}\nprint(*[name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", told], check=True, capture_output=True, text=True)
    return set(done.stdout.split())


def test_the_command_line_itself_loads_nothing_heavy() -> None:
    assert loaded("import odom.cli") == set()


def test_a_sensor_that_plays_a_folder_loads_no_compiler() -> None:
    modules = ("odom.service.input_report", "odom.wire.session", "odom.wire.ros2", "sensors.process", "sensors.tum")
    assert not loaded(f"import {', '.join(modules)}") & {"numba", "scipy", "matplotlib", "gtsam", "rerun"}


def test_a_run_loads_evaluation_recordings_and_a_bar_only_when_it_needs_them() -> None:
    assert not loaded("import odom.service.local_run") & {"matplotlib", "gtsam", "rerun", "mcap", "rich"}


@pytest.mark.alone
def test_help_is_there_at_once() -> None:
    """Bar: .3 s where the libraries that print it are loaded in .2 s; both by the same machine, in turns."""

    def took_s(*command: str) -> float:
        begun = time.perf_counter()
        subprocess.run([sys.executable, *command], check=True, capture_output=True)
        return time.perf_counter() - begun

    printers = "import typer.rich_utils"
    helps, loads = zip(*((took_s("-m", "odom", "--help"), took_s("-c", printers)) for _ in range(15)), strict=True)
    print(f"{min(helps):.3f} s, the libraries {min(loads):.3f} s")
    assert min(helps) <= 1.5 * min(loads)


@pytest.mark.alone
@pytest.mark.long
def test_a_run_of_thirty_frames_costs_little_beside_its_frames(tmp_path: Path, shared_data: Path) -> None:
    """Bar: 7 times the CPU that it takes to load the libraries once; all processes, from start to plot."""
    source, out = str(shared_data / "tum_fr1_xyz"), str(tmp_path / "out")
    run = [sys.executable, "-m", "odom", "run", source, "--end", "1", "--headless", "--out", out]
    load = [sys.executable, "-c", "import cv2, matplotlib.pyplot, numba, scipy.spatial, zenoh"]

    def cpu_s(command: list[str]) -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(command, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    runs, loads = zip(*((cpu_s(run), cpu_s(load)) for _ in range(4)), strict=True)
    print(f"{min(runs):.2f} s, the libraries {min(loads):.2f} s")
    assert min(runs) <= 7.0 * min(loads)


@pytest.mark.parametrize(("expected", "has_truth"), [(True, False), (False, True)])
def test_evaluation_is_loaded_once_there_is_truth_or_some_is_expected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, expected: bool, has_truth: bool
) -> None:
    begun = []
    monkeypatch.setattr("odom.service.evaluation_imports._load", lambda: begun.append(True))
    imports = EvaluationImports(tmp_path, expected)
    if has_truth:
        imports.begin_if_due()
        assert begun == []
        (tmp_path / "truth.txt").write_text("")
    imports.begin_if_due()
    imports.begin_if_due()
    for thread in threading.enumerate():
        if thread.name == "evaluation-imports":
            thread.join()
    assert begun == [True]
