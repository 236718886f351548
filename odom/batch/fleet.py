"""Runs jobs on this machine, or on a Dask cluster that is already running."""

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from importlib import import_module
from typing import Any

from odom.batch.job import Job
from odom.batch.worker import INTERRUPTED, run_job
from odom.errors import ConfigError, OdomError

_CONNECT_S = 10
"""Patience with a Dask scheduler that does not answer."""
_POLL_S = 0.2
"""Between two looks whether the batch was asked to stop."""

Done = Callable[[Job, str], None]
"""Called with each job that has ended, and why it failed ('' where it did not)."""


def run_here(jobs: Sequence[Job], workers: int, stop: threading.Event, done: Done) -> None:
    """Run the jobs on this machine, `workers` at a time, each in processes of its own, until `stop` is set."""
    with ThreadPoolExecutor(workers, thread_name_prefix="batch") as pool:
        waiting = {pool.submit(_unless_stopped, job, stop): job for job in jobs}
        for future in as_completed(waiting):
            done(waiting[future], _outcome(future))


def run_on_dask(jobs: Sequence[Job], address: str, stop: threading.Event, done: Done) -> None:
    """Run the jobs on the Dask cluster whose scheduler is at `address`, until `stop` is set.

    Its workers need this program and the folders of recordings and results under the same paths. What they have begun
    when `stop` is set they finish. Raises ConfigError when the package or the scheduler is missing.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise ConfigError("--dask needs the package distributed: pip install 'rgbd-odom[fleet]'") from error
    try:
        client = distributed.Client(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ConfigError(f"no Dask scheduler answers at {address}: {error}") from error
    with client:
        waiting: dict[Any, Job] = {client.submit(run_job, job, key=f"odom-{job.key}"): job for job in jobs}
        for future in _until(stop, waiting):
            failed = future.exception()
            done(waiting.pop(future), future.result() if failed is None else f"{type(failed).__name__}: {failed}")
        client.cancel(list(waiting))
        for job in waiting.values():
            done(job, "" if job.is_done else INTERRUPTED)


def _until(stop: threading.Event, waiting: dict[Any, Job]) -> Iterator[Any]:
    """Yield each future of Dask once it has ended, for the caller to take it out of those that are `waiting`."""
    while waiting and not stop.is_set():
        finished = [future for future in waiting if future.done()]
        yield from finished
        if not finished:
            stop.wait(_POLL_S)


def _unless_stopped(job: Job, stop: threading.Event) -> str:
    return INTERRUPTED if stop.is_set() else run_job(job, stop)


def _outcome(future: "Future[str]") -> str:
    error = future.exception()
    if error is None:
        return future.result()
    if isinstance(error, OdomError | OSError):
        return str(error)
    raise error
