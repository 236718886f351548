"""Modules stay short, calls stay readable, and the rooms of front-end and back-end stand in one order."""

import ast
from collections.abc import Iterator

import import_graph
import pytest

LONGEST_MODULE = 250
MOST_PARAMETERS = 8
COMPILED = {"compiled", "vectorised"}
ROOMS = {
    "frontend": ("camera", "features", "matching", "cloud_features"),
    "backend": ("map", "tracking", "mapping", "loop_closure", "odometry"),
}
SOURCES = sorted(p for top in ("odom", "sensors") for p in (import_graph.PROJECT / top).rglob("*.py"))


def decorators(function: ast.FunctionDef) -> list[str]:
    return [ast.unparse(d) for d in function.decorator_list]


def functions_in(node: ast.AST) -> Iterator[ast.FunctionDef]:
    for child in import_graph.statements_in(node):
        if isinstance(child, ast.FunctionDef):
            yield child
        yield from functions_in(child)


def is_command(function: ast.FunctionDef) -> bool:
    """Whether the parameters are a command's options: annotated with typer's."""
    return any("typer." in ast.unparse(a.annotation) for a in function.args.args if a.annotation is not None)


def test_no_module_is_longer_than_can_be_read_at_once():
    lengths = {str(p.relative_to(import_graph.PROJECT)): len(p.read_text().splitlines()) for p in SOURCES}
    assert {name: n for name, n in lengths.items() if n > LONGEST_MODULE} == {}


def test_only_compiled_kernels_and_commands_take_more_than_eight_parameters():
    long = []
    for path in SOURCES:
        for node in functions_in(import_graph.parsed(path.read_text())):
            names = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
            if len([n for n in names if n not in ("self", "cls")]) <= MOST_PARAMETERS:
                continue
            if not (COMPILED & set(decorators(node)) or is_command(node)):
                long.append(f"{path.name}: {node.name}({', '.join(names)})")
    assert long == []


@pytest.mark.parametrize("package", ROOMS)
def test_rooms_import_only_rooms_below_them(package):
    rooms = ROOMS[package]

    def room_of(module: str) -> str | None:
        parts = module.split(".")
        return parts[2] if parts[1:2] == [package] and len(parts) > 2 and parts[2] in rooms else None

    wrong = [
        f"{module} imports {name}"
        for module in import_graph.modules()
        if (room := room_of(module)) is not None
        for name in import_graph.imports_of(module)
        if (other := room_of(name)) is not None and rooms.index(other) > rooms.index(room)
    ]
    assert wrong == []
