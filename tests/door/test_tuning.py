"""Every chosen number says its unit, what a smaller or larger one costs, and where it comes from."""

import ast
import importlib
from pathlib import Path

import pytest
from import_graph import parsed

import odom
from odom.geometry.tuning import documented

ROOT = Path(odom.__file__).parent
TUNINGS = [
    ".".join(("odom", *file.relative_to(ROOT).with_suffix("").parts))
    for file in sorted(ROOT.rglob("tuning.py"))
    if file.parent.name != "geometry"
]


@pytest.fixture(scope="module")
def modules():
    """The text of every module by its path: one test looks at all, since to collect one for each took longer."""
    files = [file for package in (ROOT, ROOT.parent / "sensors") for file in sorted(package.rglob("*.py"))]
    texts = {str(file.relative_to(ROOT.parent)): file.read_text() for file in files if file.parent.name != "examples"}
    assert {"odom/geometry/se3.py", "odom/cli/run.py", "sensors/arena/building.py"} <= texts.keys()
    return texts


@pytest.mark.parametrize("module", TUNINGS)
def test_every_tuned_number_says_unit_effect_and_source(module):
    tuning = importlib.import_module(module)
    numbers = documented(tuning.Tuning)
    assert numbers
    assert tuning.Tuning() == tuning.TUNING
    for name, (value, said) in numbers.items():
        assert isinstance(value, int | float), name
        for what in ("unit", "effect", "source"):
            assert getattr(said, what).strip(" -."), f"{module}: {name} does not say its {what}"
        words = said.effect.split()
        refers = words[0] == "as" and words[1] in numbers.keys() - {name}
        assert refers or len(words) > 3, f"{module}: the effect of {name} is too short to say anything"


def is_number(node):
    """Whether an expression is made of numbers alone: literals, sums and products, tuples, calls of math or numpy."""
    match node:
        case ast.Constant(value=value):
            return isinstance(value, int | float) and not isinstance(value, bool)
        case ast.UnaryOp(operand=operand):
            return is_number(operand)
        case ast.BinOp(left=left, right=right):
            return is_number(left) and is_number(right)
        case ast.Tuple(elts=items) | ast.List(elts=items):
            return bool(items) and all(map(is_number, items))
        case ast.Call(func=ast.Attribute(value=ast.Name(id="np" | "math")), args=arguments):
            return bool(arguments) and all(map(is_number, arguments))
        case ast.Attribute(value=ast.Name(id="np" | "math")):
            return True
    return False


def undocumented(text):
    """Return the names of module-level numbers without a docstring under them or a comment beside or above."""
    lines, body = text.splitlines(), parsed(text).body
    found = []
    for node, after in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None or not is_number(node.value):
            continue
        docstring = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        beside = "  # " in lines[node.lineno - 1]
        above = node.lineno > 1 and lines[node.lineno - 2].startswith("# ")
        if not (docstring or beside or above):
            found += [ast.unparse(target) for target in getattr(node, "targets", [getattr(node, "target", None)])]
    return found


def test_no_module_has_a_number_without_a_word_on_it(modules):
    assert {name: found for name, text in modules.items() if (found := undocumented(text))} == {}


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("A = 3.0\n", ["A"]),
        ("A = 3.0**2\nB = np.cos(0.05)\nC = (1, -2)\n", ["A", "B", "C"]),
        ("A: float = 1\n", ["A"]),
        ('A = 3.0\n"""A quantile."""\n', []),
        ("A = 3.0  # a quantile\n", []),
        ("# A quantile.\nA = 3.0\n", []),
        ("A = 'text'\nB = TUNING.b\nC = True\n", []),
    ],
)
def test_a_number_is_told_from_what_is_none(text, names):
    assert undocumented(text) == names


def tuned_in_loops(text):
    """Return the compiled functions that read `TUNING`, or a global made of it: their cached code keeps old values."""
    if "TUNING" not in text:
        return []
    body = parsed(text).body
    tuned = {"TUNING"}
    for node in body:
        if isinstance(node, ast.Assign) and tuned & {name.id for name in ast.walk(node) if isinstance(name, ast.Name)}:
            tuned |= {target.id for target in node.targets if isinstance(target, ast.Name)}
    return [
        node.name
        for node in body
        if isinstance(node, ast.FunctionDef)
        and any(ast.unparse(decorator) == "compiled" for decorator in node.decorator_list)
        and tuned & {name.id for name in ast.walk(node) if isinstance(name, ast.Name)}
    ]


def test_compiled_loops_take_tuned_numbers_as_arguments(modules):
    assert {name: found for name, text in modules.items() if (found := tuned_in_loops(text))} == {}


def test_a_loop_that_reads_a_tuned_number_is_found():
    text = "A = 2 * TUNING.a\n@compiled\ndef f(x):\n    return A * x\n@compiled\ndef g(x, a):\n    return a * x\n"
    assert tuned_in_loops(text) == ["f"]
