"""What a test needs, read off its code: marks by which the tests of a kind are run together or left out."""

import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import pytest

KINDS = {
    "fast": "no process, no network, no walk drawn or recorded",
    "process": "starts processes or opens sessions, sockets or devices",
    "rendered": "works through frames that are drawn for it or recorded",
    "wallclock": "plays in real time, or bounds what takes time: without xdist (-n 0), beside what gives way (nice)",
    "alone": "compares costs, or needs all cores: a `wallclock` beside which nothing may run",
    "long": "tens of seconds each, or a quick one many times over: left out of the default command, run by .ci/run",
    "slow": "minutes long, by hand",
}
"""The marks; each test has at least one of them."""

FOLDERS = {"arena": "rendered"}
"""The kind of all tests of a folder."""
REAL_TIME_FOLDERS = ("field",)
REAL_TIME_MODULES = ("test_viewer_process",)
"""Of these, whatever starts processes or plays a device is `wallclock`: beside others a viewer drops what it shows."""

LONG_MODULES = (
    "test_losses",
    "test_forgetting",
    "test_closing_a_walk",
    "test_closed_chain",
    "test_startup",
    "test_first_hour",
    "test_robustness_bench",
    "test_sensitivity",
    "test_interrupted_commands",
    "test_merging",
    "test_bench_pipeline",
    "test_first_keyframe",
    "test_timing_becomes_known",
    "test_doctor",
    "test_doctor_causes",
    "test_mask",
    "test_nothing_tracked",
    "test_unjoined_parts",
    "test_first_start",
    "test_image_sizes",
    "test_wide_steps",
    "test_moving_bodies",
    "test_change_of_lens",
    "test_opened_map",
    "test_repeated_image",
)
"""Modules whose tests work through long walks, several runs or several starts; those that are fast remain so."""
LONG_PARAMETERS = ("desk",)
"""Parameters by which tests of whole runs are done once more, on a real recording."""

_HERE = Path(__file__).parent
_PROCESS = ("subprocess", "socket", "zenoh", "open_session", "SensorProcess")
_RENDERED = ("drawn", "painted_room", "shared_data", "RECORDING")
"""Modules, functions and fixtures: a test that uses one, itself or through helpers and fixtures, is of the kind."""


def mark(item: pytest.Item) -> None:
    """Give a test the marks of what it needs, beside those that it has."""
    if not isinstance(item, pytest.Function):
        return
    reached = _reached(item)
    for kind, names in (("process", _PROCESS), ("rendered", _RENDERED)):
        if not reached.isdisjoint(names):
            item.add_marker(kind)
    folder = item.path.parent.name
    if folder in FOLDERS:
        item.add_marker(FOLDERS[folder])
    is_in_real_time = folder in REAL_TIME_FOLDERS or item.path.stem in REAL_TIME_MODULES
    if item.get_closest_marker("alone") or (is_in_real_time and item.get_closest_marker("process")):
        item.add_marker("wallclock")
    parameters = item.callspec.params.values() if hasattr(item, "callspec") else ()
    works = item.get_closest_marker("process") or item.get_closest_marker("rendered")
    if (works and item.path.stem in LONG_MODULES) or any(
        p in LONG_PARAMETERS for p in parameters if isinstance(p, str)
    ):
        item.add_marker("long")
    if not any(item.get_closest_marker(kind) for kind in KINDS):
        item.add_marker("fast")


def _reached(item: pytest.Function) -> frozenset[str]:
    """Return the names of what a test, its fixtures and the helpers of both refer to."""
    names = tuple(item.fixturenames)
    known = item._fixtureinfo.name2fixturedefs
    fixtures = tuple(definition.func for name in names for definition in known.get(name, ()))
    return _names_from((item.function, *fixtures)).union(names)


@cache
def _names_from(things: tuple[Any, ...]) -> frozenset[str]:
    names: set[str] = set()
    seen: set[int] = set()
    waiting = [*things]
    while waiting:
        thing = waiting.pop()
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        if isinstance(thing, type):
            waiting += [member for member in vars(thing).values() if isinstance(member, FunctionType)]
            continue
        found, helpers = _refers_to(thing)
        names |= found
        waiting += helpers
    return frozenset(names)


@cache
def _refers_to(function: FunctionType) -> tuple[frozenset[str], tuple[Any, ...]]:
    """Return the names in a function's code with the modules that they are of, and what among them is of the tests."""
    names, helpers = set(), []
    for name in _names(function.__code__):
        value = function.__globals__.get(name)
        names |= {name, getattr(value, "__module__", name)}
        if isinstance(value, FunctionType | type) and _is_of_the_tests(value):
            helpers.append(value)
    return frozenset(names), tuple(helpers)


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)


def _is_of_the_tests(thing: FunctionType | type) -> bool:
    return _is_test_module(thing.__module__)


@cache
def _is_test_module(name: str) -> bool:
    return _HERE in Path(getattr(sys.modules.get(name), "__file__", None) or "/").parents
