"""What every command line user expects: a version, short help, completion in the shell."""

import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from typer.testing import CliRunner

import odom
from odom.cli import app

BIN = Path(sys.executable).parent
WITHOUT_A_SHELL = {"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
"""The name of the shell is then given on the command line: the process that runs tests is none."""


def say(*arguments: str, **environment: str) -> str:
    """What `odom ARGUMENTS` prints; it must succeed."""
    done = subprocess.run(
        [sys.executable, "-m", "odom", *arguments], capture_output=True, text=True, timeout=60, check=False,
        env={**os.environ, **environment},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_version_is_that_of_the_package() -> None:
    assert say("--version") == f"odom {version('rgbd-odom')}\n" == f"odom {odom.__version__}\n"


def test_short_help_is_help() -> None:
    for command in ((), ("run",), ("bench", "pipeline")):
        short, long = (CliRunner().invoke(app, [*command, asked]) for asked in ("-h", "--help"))
        assert short.exit_code == 0
        assert short.output == long.output


def test_the_documented_command_installs_completion_in_bash(tmp_path: Path) -> None:
    environment = {**os.environ, **WITHOUT_A_SHELL, "HOME": str(tmp_path), "PATH": f"{BIN}:{os.environ['PATH']}"}
    subprocess.run([BIN / "odom", "--install-completion", "bash"], check=True, env=environment, timeout=60)
    for words, expected in (("odom re", "record recover"), ("odom run --real", "--realtime")):
        script = f"source ~/.bashrc; COMP_WORDS=({words}); COMP_CWORD={len(words.split()) - 1}; _odom_completion odom"
        shown = subprocess.run(
            ["bash", "-c", f"{script}; echo ${{COMPREPLY[@]}}"], env=environment, capture_output=True, text=True,
            check=True, timeout=60,
        )  # fmt: skip
        assert shown.stdout.split() == expected.split()


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_can_be_shown_for_each_shell(shell: str) -> None:
    assert "_ODOM_COMPLETE" in say("--show-completion", shell, **WITHOUT_A_SHELL)
