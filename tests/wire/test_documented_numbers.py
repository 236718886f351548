import ast
from pathlib import Path

from odom import wire


def test_every_number_of_the_wire_says_its_unit_and_effect() -> None:
    """A module's number is followed by a line about it; only what a format prescribes needs none."""
    prescribed = {"_M_MMAP_THRESHOLD", "SECOND", "_FLOAT32", "_INVERSE_DEPTH", "_RECORD_HEADER", "_NO_LENGTH"}
    for module in Path(wire.__file__).parent.rglob("*.py"):
        body = ast.parse(module.read_text()).body
        for assigned, after in zip(body, [*body[1:], None], strict=True):
            if not isinstance(assigned, ast.Assign) or ast.unparse(assigned.targets[0]) in prescribed:
                continue
            names = {node.id for node in ast.walk(assigned.targets[0]) if isinstance(node, ast.Name)}
            values = [node.value for node in ast.walk(assigned.value) if isinstance(node, ast.Constant)]
            if values and all(isinstance(value, (int, float)) for value in values):
                explained = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
                assert explained, f"{module.name}: {', '.join(names)}"
