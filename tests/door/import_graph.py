"""What imports what, read from the source, and the diagram of it on the architecture page.

`python tests/door/import_graph.py` writes the diagram and the table into odom/docs/architecture.md.
"""

import ast
from collections import defaultdict
from collections.abc import Iterator, Mapping
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

PROJECT = Path(__file__).parents[2]
PAGE = PROJECT / "odom" / "docs" / "architecture.md"
BEGIN, END = "<!-- from here on written by tests/door/import_graph.py -->", "<!-- to here -->"

ORDER = (
    "odom.errors",
    "odom.geometry",
    "odom.frame",
    "odom.registration",
    "odom.frontend",
    "odom.backend",
    "odom.wire",
    "odom.map_file",
    "odom.ros2_bridge",
    "odom.evaluation",
    "odom.calibration",
    "sensors",
    "odom.viewer",
    "odom.service",
    "odom.bench",
    "odom.rgbd_recording",
    "odom",
    "odom.export",
    "odom.batch",
    "odom.cli",
    "odom.examples",
)
"""The packages from the ground up: each may import those before it."""
ALGORITHMS = ORDER[: ORDER.index("odom.wire")]
"""Pure functions and values; messages, files and processes are above them."""
ROOMS = ("odom.frontend", "odom.backend")
"""Packages made of packages."""


@cache
def modules() -> Mapping[str, Path]:
    """Every module of the product by its dotted name; a package bears the name of its folder."""
    found = {}
    for top in ("odom", "sensors"):
        for path in sorted((PROJECT / top).rglob("*.py")):
            parts = path.relative_to(PROJECT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


parsed = cache(ast.parse)
"""The tree of a module's text, which several tests look at: to make those of the product takes a second."""


@cache
def imports_of(module: str) -> frozenset[str]:
    """The modules that one imports, inside functions too, but not those for type checkers only.

    The front door alone names for them what it imports at run time by name.
    """
    found: set[str] = set()
    tree = parsed(modules()[module].read_text())
    for node in ast.walk(tree) if module == "odom" else _run_nodes(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in modules() else str(node.module) for name in names}
    return frozenset(found & modules().keys() - {module})


def _run_nodes(tree: ast.AST) -> Iterator[ast.AST]:
    for node in statements_in(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        yield node
        yield from _run_nodes(node)


def statements_in(node: ast.AST) -> Iterator[ast.AST]:
    """What stands directly inside a module or statement, without expressions: those are most of a tree."""
    return (child for child in ast.iter_child_nodes(node) if not isinstance(child, ast.expr))


def package_of(module: str) -> str:
    """The package of `ORDER` that a module belongs to; `python -m odom` is the command line."""
    if module == "odom.__main__":
        return "odom.cli"
    return max((p for p in ORDER if module == p or module.startswith(f"{p}.")), key=len)


def room_of(module: str) -> str:
    """The package or module that a module of one of the `ROOMS` belongs to, one level below it."""
    return ".".join(module.split(".")[:3])


def package_imports() -> dict[str, set[str]]:
    """Which packages a package imports, without itself."""
    graph = defaultdict(set)
    for module in modules():
        graph[package_of(module)] |= {package_of(name) for name in imports_of(module)} - {package_of(module)}
    return graph


def room_imports(package: str) -> dict[str, set[str]]:
    """The same among the rooms of one package; its own module, which only hands names on, is left out."""
    inside = [module for module in modules() if module.startswith(f"{package}.")]
    graph: dict[str, set[str]] = defaultdict(set)
    for module in inside:
        graph[room_of(module)] |= {room_of(name) for name in imports_of(module) & {*inside}} - {room_of(module)}
    return graph


def reduced(graph: Mapping[str, set[str]]) -> dict[str, list[str]]:
    """The graph without the arrows that follow from others."""
    below: dict[str, set[str]] = {}
    for node in TopologicalSorter(graph).static_order():
        below[node] = set().union(*({name} | below[name] for name in graph.get(node, ())))
    return {
        node: sorted(name for name in names if not any(name in below[other] for other in names))
        for node, names in sorted(graph.items())
    }


def diagram(graph: Mapping[str, set[str]]) -> list[str]:
    """The lines of a Mermaid diagram of what imports what."""
    arrows = [f"    {name} --> {other}" for name, below in reduced(graph).items() for other in below]
    return ["```mermaid", "flowchart TD", *arrows, "```"]


def first_line(module: str) -> str:
    """The first sentence of a module's docstring."""
    text = ast.get_docstring(parsed(modules()[module].read_text())) or ""
    return " ".join(text.split("\n\n")[0].split())


def written() -> str:
    """What the architecture page holds between its two marks."""
    lines = [*diagram(package_imports()), "", "Inside, packages made of packages:", ""]
    for package in ROOMS:
        rooms = {room: names for room, names in room_imports(package).items() if modules()[room].name == "__init__.py"}
        lines += [*diagram({room: names & rooms.keys() for room, names in rooms.items()}), ""]
    lines += ["| package | what it is |", "|---|---|"]
    for package in reversed(ORDER):
        lines.append(f"| `{package}` | {first_line(package)} |")
        for room in sorted(
            m for m in modules() if package in ROOMS and room_of(m) == m and m.startswith(f"{package}.")
        ):
            lines.append(f"| &emsp;`{room.removeprefix(f'{package}.')}` | {first_line(room)} |")
    return "\n".join(lines)


def main() -> None:
    """Write the page anew."""
    before, rest = PAGE.read_text().split(BEGIN)
    PAGE.write_text(f"{before}{BEGIN}\n\n{written()}\n\n{END}{rest.split(END)[1]}")


if __name__ == "__main__":
    main()
