"""Where compiled loops are kept: a folder of these contents, one that can be written, this user's alone."""

import fcntl
import importlib
import os
import shutil
import subprocess
import sys
import threading
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from odom.geometry import compiled


@pytest.fixture(autouse=True)
def _forgotten():
    compiled._cache_folder.cache_clear()
    yield
    compiled._cache_folder.cache_clear()


def test_a_folder_that_cannot_be_written_is_passed_over(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setattr(compiled, "_places", lambda: iter([tmp_path / "file" / "below", tmp_path / "good"]))
    assert Path(compiled._cache_folder("registration")).parent == tmp_path / "good"


def test_other_contents_have_another_folder_and_leave_no_litter(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled, "_places", lambda: iter([tmp_path]))
    first, neighbour = compiled._cache_folder("frontend"), compiled._cache_folder("backend")
    compiled._cache_folder.cache_clear()
    monkeypatch.setattr(compiled, "_digest", lambda *_: "other")
    second = compiled._cache_folder("frontend")
    assert second != first
    assert {str(p) for p in tmp_path.iterdir()} == {second, neighbour}


def test_a_change_below_is_a_change_above_and_not_the_other_way_round(tmp_path, monkeypatch):
    for package in ("registration", "frontend", "backend"):
        (tmp_path / package).mkdir()
    monkeypatch.setattr(compiled, "__file__", str(tmp_path / "registration" / "compiled.py"))
    before = [compiled._digest(package) for package in ("registration", "frontend", "backend")]
    (tmp_path / "frontend" / "loop.py").write_text("changed")
    after = [compiled._digest(package) for package in ("registration", "frontend", "backend")]
    assert [a == b for a, b in zip(before, after, strict=True)] == [True, False, False]


def test_a_change_beside_a_function_of_no_such_package_is_a_change_to_it_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.syspath_prepend(str(tmp_path))

    def folders():
        compiled._cache_folder.cache_clear()
        found = []
        for name in ("one.inner.loops", "one.loops", "two.loops"):
            sys.modules.pop(name, None)
            home = compiled._home(importlib.import_module(name).plain)
            found.append(compiled._cache_folder(*home))
        return found

    for package in ("one/inner", "one", "two"):
        (tmp_path / package).mkdir(parents=True, exist_ok=True)
        (tmp_path / package / "loops.py").write_text("def plain(a):\n    return a\n")
        (tmp_path / package / "called.py").write_text("")
    before = folders()
    (tmp_path / "one" / "inner" / "called.py").write_text("changed = True")
    after = folders()
    assert len(set(before)) == 3
    assert [a == b for a, b in zip(before, after, strict=True)] == [False, True, True]
    assert all(Path(folder).is_dir() for folder in after)


def test_the_environment_names_the_place(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert Path(compiled._cache_folder("registration")).parent == tmp_path


def test_a_temporary_folder_that_others_may_write_is_not_trusted(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled.tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / f"odom-{os.getuid()}").mkdir(mode=0o777)
    (tmp_path / f"odom-{os.getuid()}").chmod(0o777)
    places = list(compiled._places())
    assert tmp_path / f"odom-{os.getuid()}" not in places
    assert places[-1].stat().st_mode & 0o077 == 0


def test_what_is_compiled_waits_while_another_process_saves_there(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))

    @compiled.compiled
    def double(a):
        return 2 * a

    folder = Path(compiled._cache_folder(*__name__.split(".")[1:2]))
    waiting = threading.Thread(target=double, args=(1.0,))
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        waiting.start()
        waiting.join(1.5)
        assert waiting.is_alive()
        assert not list(folder.rglob("*.nbi"))
    waiting.join(30.0)
    assert len(list(folder.rglob("*.nbc"))) == 1


def test_a_loop_runs_also_where_a_newer_version_has_deleted_the_folder_meanwhile(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))

    @compiled.compiled
    def treble(a):
        return 3 * a

    shutil.rmtree(compiled._cache_folder(*__name__.split(".")[1:2]))
    assert treble(2.0) == 6.0


def test_only_what_was_noted_to_be_whole_counts_as_compiled_before(tmp_path, monkeypatch):
    """A first start that was stopped half-way has compiled something of every package."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    for package in compiled._FLOORS:
        (Path(compiled._cache_folder(package)) / "loops.1.nbc").touch()
    assert not compiled.compiled_before()
    compiled.note_all_compiled()
    assert compiled.compiled_before()


def test_what_was_loaded_can_be_compiled_into_a_caller_and_is_parsed_only_then(tmp_path):
    code = """
import sys
from odom.geometry.compiled import compiled

@compiled
def half(a):
    return a / 2

@compiled
def quarter(a):
    return half(half(a))

def parsed():
    return half.overloads[half.signatures[0]].library._shared_module is not None

half(3.0)
print(len(half.stats.cache_hits), parsed())
if len(sys.argv) > 1:
    print(quarter(3.0), parsed())
"""
    (tmp_path / "loops.py").write_text(code)
    command = [sys.executable, str(tmp_path / "loops.py")]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    run = partial(subprocess.run, env=environment, capture_output=True, text=True, check=True, timeout=120)
    run(command)
    assert run(command).stdout.split() == ["1", "False"]
    assert run([*command, "and its caller"]).stdout.split() == ["1", "False", "0.75", "True"]


@pytest.mark.slow
def test_a_second_process_loads_what_the_first_compiled(tmp_path):
    code = (
        "import time; from odom.registration import warm_up; t = time.process_time(); warm_up();"
        "print(time.process_time() - t)"
    )
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", code]
    seconds = [
        float(subprocess.run(command, env=environment, capture_output=True, check=True, timeout=280).stdout)
        for _ in range(2)
    ]
    assert seconds[1] < 0.25 * seconds[0]
    assert any(Path(tmp_path).rglob("*.nbc"))


def test_no_loop_of_the_project_needs_a_cache_folder_of_numbas_own(tmp_path):
    """Numba's own are in the installation and below the home directory: neither can be written everywhere."""
    code = """
from numba.core import caching
def ensure_cache_path(self):
    if "UserProvided" not in type(self).__name__:
        raise PermissionError("read-only")
caching._CacheLocator.ensure_cache_path = ensure_cache_path
import pathlib, importlib
for root in ("odom", "sensors"):
    for file in sorted(pathlib.Path(root).rglob("*.py")):
        if "import compiled" in file.read_text() or "njit" in file.read_text():
            importlib.import_module(".".join(file.with_suffix("").parts))
"""
    root = Path(compiled.__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


def test_importing_se3_does_not_load_the_compiler():
    code = "import sys, odom.geometry.se3; print('numba' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert run.stdout.strip() == "False"


def test_compiled_functions_divide_by_zero_like_numpy():
    @compiled.compiled
    def divide(a, b):
        return a / b

    assert divide(1.0, 0.0) == np.inf


def test_products_and_sums_are_rounded_one_by_one():
    @compiled.compiled
    def multiply_and_add(a, b, c):
        return a * b + c

    a = 1.0 + 2.0**-30
    assert multiply_and_add(a, a, -a * a) == 0.0  # a fused multiply-add leaves what the product was rounded by


def test_a_function_is_compiled_once_whatever_constants_it_is_called_with():
    @compiled.compiled
    def added(x, more):
        return x + more

    @compiled.compiled
    def twice(x):
        return added(added(x, 1), 2)

    assert twice(3) == 6
    assert len(added.signatures) == 1
