"""One job: `odom run` in processes of its own, started again when something kills them."""

import json
import shutil
import threading
import uuid
from collections import deque
from pathlib import Path

from odom.batch.job import Job, program_hash
from odom.errors import ConfigError
from odom.service.child_process import CALLED_WRONGLY, ChildProcess
from odom.service.log_form import JSON_ENVIRONMENT
from sensors.process import END_OF_SOURCE

_ATTEMPTS, _ATTEMPTS_FAILED = 5, 2
"""Starts of one recording: of runs that were killed, and of those that failed by themselves. Fewer: a machine short of
memory loses recordings; more: one that always fails costs more time."""
_STOP_S = 60.0
"""A run that is asked to stop may save for so long before it is killed."""
_POLL_S = 0.2
"""Between two looks at the run: so late its end is noticed."""
_LAST_WORDS = 5
"""Lines that a failed run's message may hold."""

INTERRUPTED = "interrupted"


def run_job(job: Job, stop: threading.Event | None = None) -> str:
    """Run a job unless its results are there; return why it failed, nothing when it did not.

    Its folder appears whole, whatever is killed meanwhile, and however many work on it at the same time. Raises
    ConfigError when this is another version of the program than the one that planned the job.
    """
    if job.is_done:
        return ""
    if program_hash() != job.program:
        raise ConfigError("this worker has another version of the program: install the one that the batch was begun by")
    why = ""
    failed = 0
    for _ in range(_ATTEMPTS):
        partial = job.results / f"{job.key}.{uuid.uuid4().hex}.part"
        try:
            status, why = _attempt(job, partial, stop)
            if not why:
                _take_over(partial, job.folder)
        finally:
            shutil.rmtree(partial, ignore_errors=True)
        if stop is not None and stop.is_set():
            return "" if job.is_done else INTERRUPTED
        if job.is_done:
            _remove_partial(job)
            return ""
        failed += status is not None and status >= 0
        if status == CALLED_WRONGLY or failed >= _ATTEMPTS_FAILED:
            break
    return why


def _attempt(job: Job, partial: Path, stop: threading.Event | None) -> tuple[int | None, str]:
    """Run once into the folder `partial`; return the exit status and why that did not lead to results."""
    words: deque[str] = deque(maxlen=_LAST_WORDS)
    arguments = ["run", str(job.path), "--headless", "--out", str(partial), *job.arguments]
    plain = {**dict(job.environment), JSON_ENVIRONMENT: "0"}
    child = ChildProcess("run", arguments, plain, lambda _, line: words.append(line))
    try:
        while not child.wait(_POLL_S):
            if stop is not None and stop.is_set():
                break
    finally:
        child.stop(_STOP_S)
    if child.status != 0:
        said = [line.removeprefix("odom: ") for line in words if line.startswith("odom: ")]
        return child.status, said[-1] if said else f"the run {child.ending()}"
    try:
        report = json.loads((partial / "report.json").read_text())
    except (OSError, ValueError) as error:
        return 0, f"no report: {error}"
    if report.get("source_end") != END_OF_SOURCE or report["lost_frames"]:
        return 0, "the run did not reach the end of the recording"
    return 0, ""


def _take_over(partial: Path, folder: Path) -> None:
    """Give whole results their name, unless another worker was quicker: its results are the same."""
    try:
        partial.rename(folder)
    except OSError:
        if not folder.is_dir():
            raise


def _remove_partial(job: Job) -> None:
    """Remove what killed workers left of this job."""
    for left in job.results.glob(f"{job.key}.*.part"):
        shutil.rmtree(left, ignore_errors=True)
