"""What a person wants to know of the report of a run, in a few lines."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

Report = dict[str, Any]


def summary(report: Report, folder: Path) -> Iterator[str]:
    """Yield the lines; of a report that lacks fields, since a process died or the disk was full, those that it has.

    No file is named that is not in the `folder`, nor the folder when it is gone.
    """
    yield _tracking(report)
    segments = report.get("segments") or []
    if len(segments) > 1 and (folder / "trajectory.txt").is_file():
        poses = [part["frames"] for part in segments]
        yield f"trajectory.txt is the largest of {len(poses)} parts never joined: {poses[0]} of {sum(poses)} poses"
    if report.get("fps") is not None:
        processing = report["processing_ms"]
        yield (
            f"{report['fps']:.0f} frames/s, {processing['p50']:.1f} ms a frame (p99 {processing['p99']:.1f}), "
            f"{report['cpu_ms_per_frame']:.1f} ms CPU"
        )
    yield from _refused(report)
    if report.get("unmatched_frames"):
        yield f"{report['unmatched_frames']} frames had no depth image beside them; they are used all the same"
    if report.get("unwritten") and folder.is_dir():
        yield f"{report['unwritten']} lines, files or changes of the map are not written: make room, then run it again"
    if report.get("ate_m") is not None:
        yield (
            f"against truth ({report['matched']}/{report['total']} poses): ATE {_figure(report['ate_m'], 4)} m, "
            f"drift {_figure(report['rpe_1s_m'], 4)} m and {_figure(report['rpe_1s_deg'], 2)} deg over 1 s"
        )
    for note in report.get("truth_notes") or ():
        yield f"note: {note}"
    if (folder / "camera-calibrated.yaml").is_file():
        yield from _calibration(report)
    for name, ending in report.get("failed", {}).items():
        yield f"the {name} {ending}" + ("; the run went on without it" if name in ("viewer", "recorder") else "")
    if folder.is_dir():
        yield f"files: {folder}"


def _tracking(report: Report) -> str:
    given = report.get("colour", {}).get("given", report["frames"])
    tracked, share = f"{report['tracked']} of {given} frames tracked", report.get("completeness")
    if share is None or "loop_closures" not in report:
        return tracked
    parts, closures = len(report.get("segments") or ()), report["loop_closures"]
    return f"{tracked} ({share:.1%}), {parts} segment(s), {closures} loop closure(s)"


def _refused(report: Report) -> Iterator[str]:
    for stream in ("colour", "depth"):
        images = report.get(stream, {})
        if refused := images.get("refused"):
            reasons = ", ".join(f"{count} {why}" for why, count in refused.items())
            yield f"{stream} images: {images['used']} of {images['given']} used; not used: {reasons}"


def _calibration(report: Report) -> Iterator[str]:
    """Yield what changed of a calibration that was found poor."""
    if report.get("calibration_off_px") is None or "calibration_kept" in report:
        return
    changes = ", ".join(
        f"{name} {start:.1f} -> {now:.1f} ± {sigma:.1f}"
        for name, (start, now, sigma) in report["calibration"].items()
        if name in ("fx", "fy", "cx", "cy")
    )
    yield (
        f"the calibration given is off by {report['calibration_off_px']:.1f} px: trajectory.txt is adjusted by "
        f"camera-calibrated.yaml ({changes} px), odometry.txt is as it was published; next time give that as --camera"
    )


def _figure(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
