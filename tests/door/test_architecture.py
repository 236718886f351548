"""Imports go down, never up and never round; the architecture page shows them as they are."""

from graphlib import TopologicalSorter

import import_graph
import pytest


def test_no_import_goes_round():
    graph = {module: import_graph.imports_of(module) for module in import_graph.modules()}
    assert len(tuple(TopologicalSorter(graph).static_order())) == len(graph)  # raises CycleError, naming the circle


@pytest.mark.parametrize("package", import_graph.ORDER)
def test_no_package_imports_one_above_it(package):
    allowed = import_graph.ORDER[: import_graph.ORDER.index(package)]
    wrong = [
        f"{module} imports {name}"
        for module in import_graph.modules()
        if import_graph.package_of(module) == package
        for name in import_graph.imports_of(module)
        if import_graph.package_of(name) not in (*allowed, package)
    ]
    assert wrong == []


@pytest.mark.parametrize(
    "package", [p for p in import_graph.ORDER if p not in ("odom.rgbd_recording", "odom", "odom.examples")]
)
def test_no_room_of_a_package_imports_round(package):
    graph = import_graph.room_imports(package)
    assert len(tuple(TopologicalSorter(graph).static_order())) == len(graph)


def test_tracking_knows_the_map_but_never_what_makes_it():
    seen, onward = set(), ["odom.backend.tracking"]
    while onward:
        room = onward.pop()
        seen.add(room)
        onward += import_graph.room_imports("odom.backend")[room] - seen
    assert "odom.backend.map" in seen
    assert not seen & {f"odom.backend.{room}" for room in ("mapping", "loop_closure", "odometry", "chain")}


def test_algorithms_know_no_messages_files_or_processes():
    wrong = [
        f"{module} imports {name}"
        for module in import_graph.modules()
        if import_graph.package_of(module) in import_graph.ALGORITHMS
        for name in import_graph.imports_of(module)
        if import_graph.package_of(name) not in import_graph.ALGORITHMS
    ]
    assert wrong == []


def test_every_module_is_in_a_package_of_the_order():
    for module in import_graph.modules():
        assert import_graph.package_of(module) != "odom" or module == "odom", module


def test_the_page_shows_the_imports_as_they_are():
    text = import_graph.PAGE.read_text().split(import_graph.BEGIN)[1].split(import_graph.END)[0].strip()
    assert text == import_graph.written(), "bring it up to date: python tests/door/import_graph.py"
