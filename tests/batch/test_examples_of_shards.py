"""The files for Slurm and Kubernetes say what `odom batch` understands."""

import re
import shlex
import subprocess
from pathlib import Path

import pytest
import typer
import yaml

from odom.batch.job import shard_of
from odom.batch.recordings import Recording
from odom.cli import app

EXAMPLES = Path(__file__).parents[2] / "odom" / "examples"
SLURM, KUBERNETES = EXAMPLES / "batch_slurm.sh", EXAMPLES / "batch_kubernetes.yaml"
RECORDINGS = tuple(Recording(str(i), Path(str(i))) for i in range(20))


def understood(line):
    """The parameters of an `odom batch` command line, by the program's own parser."""
    words = shlex.split(line)
    assert words[:2] == ["odom", "batch"]
    command = typer.main.get_command(app).commands["batch"]
    return command.make_context("batch", words[2:]).params


def covered(parameters, expand, count):
    parts = [shard_of(RECORDINGS, expand(parameters["shard"], i)) for i in range(count)]
    return sorted(recording.name for part in parts for recording in part)


def test_the_slurm_array_covers_all_recordings():
    text = SLURM.read_text()
    first, last = map(int, re.search(r"#SBATCH --array=(\d+)-(\d+)", text).groups())
    parameters = understood(re.search(r"^exec (odom batch .*)$", text, re.MULTILINE)[1])

    def expand(shard, i):
        return shard.replace("$SLURM_ARRAY_TASK_ID", str(i)).replace("$SLURM_ARRAY_TASK_COUNT", str(last - first + 1))

    assert first == 0
    assert covered(parameters, expand, last + 1) == sorted(r.name for r in RECORDINGS)


@pytest.mark.process
def test_the_slurm_script_is_a_script():
    subprocess.run(["sh", "-n", SLURM], check=True)


def test_the_indexed_job_covers_all_recordings():
    job = yaml.safe_load(KUBERNETES.read_text())
    spec = job["spec"]
    assert (job["kind"], spec["completionMode"]) == ("Job", "Indexed")
    shell, option, line = spec["template"]["spec"]["containers"][0]["command"]
    assert (shell, option) == ("sh", "-c")
    parameters = understood(line.removeprefix("exec "))
    wanted = covered(parameters, lambda shard, i: shard.replace("$JOB_COMPLETION_INDEX", str(i)), spec["completions"])
    assert wanted == sorted(r.name for r in RECORDINGS)


@pytest.mark.parametrize("path", [SLURM, KUBERNETES], ids=lambda path: path.name)
def test_the_line_that_writes_the_table_is_understood(path):
    (line,) = re.findall(r"^#\s+(odom batch .*)$", path.read_text(), re.MULTILINE)
    assert understood(line)["shard"] is None
