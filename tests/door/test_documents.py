"""What the documents say can be typed: commands, options, settings, paths, links and Python are those of the code."""

import itertools
import os
import re
import shlex
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
import typer
import yaml
from pydantic import BaseModel

from odom.cli import app
from odom.cli.optional_domain import filled_in
from odom.service import previous_results
from odom.service.settings import Settings

PROJECT = Path(__file__).parents[2]
DOCUMENTS = [
    *(PROJECT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "recordings/README.md")),
    *sorted((PROJECT / "odom").rglob("*.md")),
]
COMMAND = re.compile(r"(?:^|[\s`(])(?:\.venv/bin/)?odom (?=[-a-z])([^`|]*?)(?=`|$|\s&&|\s#)", re.MULTILINE)


def code_of(text):
    """The blocks and spans of code of a document, one a line; a line that ends in a backslash goes on."""
    blocks = re.findall(r"^```(?:sh)?\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    rest = re.sub(r"^```\w*\n.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    indented = [line for line in rest.splitlines() if line.startswith("    ")]
    spans = re.findall(r"`([^`\n]+)`", "\n".join(line for line in rest.splitlines() if not line.startswith("    ")))
    return "\n".join([*blocks, "\n".join(indented).replace("\\\n", " "), *spans])


def commands_of(document):
    return [found.strip() for found in COMMAND.findall(code_of(document.read_text()))]


@cache
def program():
    return typer.main.get_command(app)


def parse(words):
    """Walk a command line through the program's own parser; raises AssertionError at what it does not know."""
    command = program()
    words = iter(words)
    for word in words:
        if word.startswith("-") and len(word) > 1:
            name, _, given = word.partition("=")
            options = {opt: param for param in command.params for opt in (*param.opts, *param.secondary_opts)}
            assert name in options or name == "--help", f"no option {name}"
            takes = 0 if name == "--help" or getattr(options[name], "is_flag", False) or given else options[name].nargs
            assert len(list(itertools.islice(words, takes))) == takes, f"{name} lacks its value"
        elif hasattr(command, "commands") and word != "...":
            assert word in command.commands, f"no command {word}"
            command = command.commands[word]
    return command


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(PROJECT)))
def test_every_command_is_understood(document):
    for line in commands_of(document):
        try:
            parse(filled_in(shlex.split(line)))
        except AssertionError as error:
            pytest.fail(f"{document.name}: odom {line}: {error}")


def test_the_readmes_commands_are_found():
    lines = commands_of(PROJECT / "README.md")
    assert len(lines) > 30
    named = {parse(filled_in(shlex.split(line))).name for line in lines}
    assert {"run", "sensor", "serve", "record", "view", "router", "doctor", "eval", "config", "registration"} <= named


@pytest.mark.parametrize("line", ["fly", "run --fast", "bench speed", "view --host"])
def test_what_is_no_command_is_noticed(line):
    with pytest.raises(AssertionError):
        parse(shlex.split(line))


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(PROJECT)))
def test_links_lead_somewhere(document):
    for target in re.findall(r"\]\(([^)\s]+)\)", document.read_text()):
        if not re.match(r"https?:", target):
            path, _, heading = target.partition("#")
            page = (document.parent / path) if path else document
            assert page.exists(), f"{document.name}: {target}"
            headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE) if heading else []
            assert not heading or heading in [h.lower().replace(" ", "-") for h in headings], target


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(PROJECT)))
def test_paths_of_this_project_are_there(document):
    for path in re.findall(r"(?<![\w./-])(?:odom|sensors|tests|recordings)/[\w./@-]*\w", code_of(document.read_text())):
        assert (PROJECT / path).exists(), f"{document.name}: {path}"


def test_modules_that_the_pages_name_alone_exist():
    there = {path.name for folder in ("odom", "sensors", "tests") for path in (PROJECT / folder).rglob("*.py")}
    pages = [document for document in DOCUMENTS if document.name != "CHANGELOG.md"]
    named = {name for document in pages for name in re.findall(r"`(\w+\.py)`", document.read_text())}
    assert "frame_stages.py" in named
    assert named <= there


def variables(model, prefix):
    for name, field in model.model_fields.items():
        variable = f"{prefix}{name.upper()}"
        yield variable
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from variables(field.annotation, f"{variable}__")


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(PROJECT)))
def test_environment_variables_are_settings(document):
    named = set(re.findall(r"\bODOM_[A-Z]+__[A-Z0-9_]+", document.read_text()))
    assert named <= set(variables(Settings, "ODOM_"))


BLOCKS = re.findall(r"^```python\n(.*?)^```", (PROJECT / "README.md").read_text(), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize(("number", "says"), [(0, "State.TRACKING"), (1, "True [[")])
def test_the_readmes_programs_run_as_they_stand(number, says, tmp_path):
    assert len(BLOCKS) == 2
    assert len(BLOCKS[number].splitlines()) <= 11
    shown = subprocess.run(
        [sys.executable, "-"], input=BLOCKS[number], check=True, capture_output=True, text=True, cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(PROJECT)},
    ).stdout  # fmt: skip
    assert says in shown
    assert "LOST" not in shown


def test_the_readme_explains_each_file_that_a_run_leaves():
    text = (PROJECT / "README.md").read_text()
    for pattern in (*previous_results._RESULTS, previous_results._SHOWN):
        name = pattern.replace("[0-9]*", "N")
        assert re.search(rf"^\|[^|]*`{re.escape(name)}`", text, re.MULTILINE), name


def test_tests_that_are_to_show_figures_run_in_one_process():
    """Processes of pytest-xdist, which the project's options start, show nothing of what `-s` lets through."""
    pages = [*DOCUMENTS, *(PROJECT / "tests").rglob("test_*.py")]
    lines = {line for page in pages for line in re.findall(r"\bpytest (-[^`\n]*)", page.read_text())}
    assert any("-s" in line.split() for line in lines)
    assert not {line for line in lines if "-s" in line.split() and "-n 0" not in line}


def test_the_hooks_before_a_commit_check_what_ci_checks():
    (local,) = yaml.safe_load((PROJECT / ".pre-commit-config.yaml").read_text())["repos"]
    hooks = {hook["entry"].removeprefix("python -m ") for hook in local["hooks"]}
    checks = re.findall(r"^\s*\.venv/bin/((?:ruff|mypy).*)$", (PROJECT / ".ci" / "run").read_text(), re.MULTILINE)
    assert {check.removesuffix(" .") for check in checks} == hooks
