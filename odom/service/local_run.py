"""`odom run`: from the first frame of a source to the report of its run, on one machine."""

import json
import logging
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from odom.errors import OdomError
from odom.service import previous_results
from odom.service.calibration_offer import keep_depth_images, remember_calibration
from odom.service.failed_tracking import why_not_tracked, why_poor
from odom.service.input_report import with_source
from odom.service.progress import open_display
from odom.service.result_files import write_json
from odom.service.run_folder import held
from odom.service.run_processes import RunPlan, RunProcesses
from odom.service.settings import Settings
from odom.wire import Topics
from odom.wire.session import open_session
from sensors.source import Source

_LOG = logging.getLogger(__name__)

Report = dict[str, Any]


def run(
    plan: RunPlan,
    settings: Settings,
    stop: threading.Event,
    tell: Callable[[Report], None],
    open_again: Callable[[], Source] | None = None,
) -> None:
    """Run the source to its end, or until `stop` is set, and `tell` the report that was written to `plan.out`.

    The report comes before the wait for a viewer that stays open, and also after a failure, if there was a frame.
    Results of an earlier run there are set aside first: if this one ended at once, they would be taken for its own.

    Raises ConfigError when another run writes there; at the end OdomError naming the processes that failed, or
    with the reason when no frame was tracked: a recorded source is opened again to find it. Results are saved before
    that.
    """
    with held(plan.out) as lock:
        if (aside := previous_results.set_aside(plan.out, shown=True)) is not None:
            _LOG.info("the results of an earlier run are in %s", aside)
        report, was_stopped = _run(plan, settings, stop, tell, lock)
    if not report.get("tracked"):
        frames = report.get("frames")
        none = f"none of the {frames} frames was tracked" if frames else "no frame was processed"
        stopped = "the run was stopped before the first"
        why = stopped
        if not was_stopped:
            why = why_not_tracked(report, plan.source, open_again, settings.service.mask, plan.start)
        raise OdomError(f"{none}: {why}")
    if open_again is None or was_stopped:
        return
    if fault := why_poor(report, plan.out, open_again, settings.service.mask):
        _LOG.warning("do not trust this result: %s", fault)


def _run(
    plan: RunPlan, settings: Settings, stop: threading.Event, tell: Callable[[Report], None], folder_lock: int
) -> tuple[Report, bool]:
    """Run, and return the report, and whether `stop` was set before the source had ended.

    Raises OdomError when a process failed or the report could not be written.
    """
    endpoint = free_endpoint()
    wire = settings.wire.model_copy(update={"mode": "peer", "connect": (), "listen": (endpoint,)})
    begun = time.monotonic()
    with open_session(wire) as session:
        with open_display() as display:
            display.say("run", f"to watch it: {watching(endpoint, wire.namespace)}")
            processes = RunProcesses(plan, settings, endpoint, session, display, folder_lock)
            try:
                processes.work(stop)
            finally:
                processes.end_work()
        try:
            report = complete_report(plan.out, processes)
            keep_depth_images(plan.out, plan.source, plan.camera)
            if plan.remember:
                remember_calibration(plan.out, (processes.reports["sensor"] or {}).get("serial", ""))
            if report.get("frames"):
                tell(report)
            if plan.stay and not processes.was_stopped:
                processes.keep_viewer(stop)
        finally:
            processes.end_viewer()
    written = _write(plan.out, report | _resources(processes, time.monotonic() - begun))
    if failed := processes.failures:
        endings = ", ".join(f"the {child.name} {child.ending()}" for child in failed)
        raise OdomError(f"{endings}; what was done so far is in {plan.out}")
    if not written:
        raise OdomError(f"{plan.out} holds no report.json, since it could not be written: make room, then run it again")
    if unwritten := report.get("unwritten"):
        raise OdomError(f"{unwritten} lines, files or changes of the map are not written: make room, then run it again")
    return report, processes.was_stopped


def watching(endpoint: str, namespace: str) -> str:
    """Return the command line that opens another viewer of the run on this machine."""
    device = "" if namespace == Topics().namespace else f" --namespace {namespace}"
    return f"odom view --connect {endpoint}{device}"


def free_endpoint() -> str:
    """Return a free loopback endpoint: two runs on one machine do not mix."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def complete_report(out: Path, processes: RunProcesses) -> Report:
    """Return the odometry's report with those of the other processes and the errors against truth, and write it.

    Where the odometry could not write its report, the one it printed is used; where it died, its last status.
    """
    path = out / "report.json"
    handed_up = processes.reports["odometry"] or dict(processes.counts)
    report: Report = json.loads(path.read_text()) if path.is_file() else handed_up
    report = with_source(report, processes.reports["sensor"])
    report["failed"] = {child.name: child.ending() for child in processes.failed}
    if (out / "truth.txt").is_file() and (out / "trajectory.txt").is_file():
        from odom.evaluation.run_report import report_with_truth

        try:
            judged = report_with_truth(out, total_frames=processes.total)
            both = {name: (report.get(name) or {}) | (judged.get(name) or {}) for name in ("chain", "chain_closed")}
            unwritten = report.get("unwritten", 0) + judged.get("unwritten", 0)
            report |= judged | both | {"unwritten": unwritten}
        except (OdomError, OSError) as error:
            report["truth_notes"] = [str(error)]
            _LOG.warning("not judged against truth: %s", error)
    _write(out, report)
    return report


def _resources(processes: RunProcesses, elapsed_s: float) -> Report:
    children = processes.children.values()
    peaks = {child.name: round(child.peak_rss_mb, 1) for child in children}
    return {
        "failed": {child.name: child.ending() for child in processes.failed},
        "peak_rss_mb": {"sensor": None, "odometry": None, "viewer": None} | peaks,
        "cpu_s": {child.name: round(child.cpu_s, 2) for child in children},
        "elapsed_s": round(elapsed_s, 2),
    }


def _write(out: Path, report: Report) -> bool:
    try:
        write_json(out / "report.json", report)
    except OSError as error:
        _LOG.error("%s cannot be written: %s", out / "report.json", error.strerror)
        return False
    return True
