"""A number with a name says what it is: its unit, and what a larger or smaller one would do."""

import ast
from pathlib import Path

import pytest

import odom

MODULES = [p for room in ("service", "viewer", "cli") for p in sorted((Path(odom.__file__).parent / room).glob("*.py"))]
COLOURS = "palette.py"


@pytest.mark.parametrize("module", MODULES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_every_number_has_a_word_beside_it(module: Path) -> None:
    """The line about it follows the number, or the group of numbers that belong together."""
    body = ast.parse(module.read_text()).body if module.name != COLOURS else []
    for i, assigned in enumerate(body):
        if not isinstance(assigned, ast.Assign):
            continue
        values = [node.value for node in ast.walk(assigned.value) if isinstance(node, ast.Constant)]
        if values and all(isinstance(value, (int, float)) for value in values):
            after = next((other for other in body[i + 1 :] if not isinstance(other, ast.Assign)), None)
            explained = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            assert explained, f"{module}:{assigned.lineno}: {ast.unparse(assigned.targets[0])}"
