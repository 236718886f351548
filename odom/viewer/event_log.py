"""The log of events and the summary of the present state, in plain words."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime

import rerun as rr

from odom.evaluation import Trajectory
from odom.frame import Stamp, to_seconds
from odom.viewer import entities, palette
from odom.viewer.entities import EntityUpdate, update
from odom.viewer.truth_alignment import PoseError, TruthInMap
from odom.wire.codec import Loop, Status

INFO, WARN, ERROR, DETAIL = "INFO", "WARN", "ERROR", "DEBUG"

_STATES: Mapping[str, tuple[str, str, palette.Rgb]] = {
    "TRACKING": (INFO, "Tracking", palette.GOOD),
    "RECOVERED": (INFO, "Recovered", palette.GOOD),
    "UNCERTAIN": (WARN, "Uncertain", palette.WARN),
    "LOST": (ERROR, "Lost", palette.BAD),
}
_NUMBER = re.compile(r"\d+(\.\d+)?")
_REFUSED_EVERY_NS = 5_000_000_000
"""Between two lines about refused loops: in a corridor every key frame has some, which would hide the rest."""


def log_line(stamp: Stamp, level: str, text: str, color: palette.Rgb | None = None) -> EntityUpdate:
    """Return a line of the log."""
    clock = datetime.fromtimestamp(to_seconds(stamp), UTC).strftime("%H:%M:%S")
    return update(entities.LOG, stamp, rr.TextLog(f"{clock}  {text}", level=level, color=color))


@dataclass
class EventLog:
    """Turns changes of status, loops and truth into lines, and the present state into a short table."""

    _state: tuple[str, str] = ("", "")
    _logged: tuple[str, str] = ("", "")
    _values: Mapping[str, str] = field(default_factory=dict)
    _accepted: int = 0
    _refused: int = 0
    _unlogged: int = 0
    _last_refused: Stamp | None = None
    _error: PoseError | None = None
    _calibrated: bool = False

    def status(self, stamp: Stamp, status: Status) -> Iterator[EntityUpdate]:
        """Yield a line when the state or its reason has changed, in more than its numbers."""
        self._values = {**self._values, **status.values}
        state = status.values.get("state", "")
        reason = status.values.get("reason", status.message)
        kind = (state, _NUMBER.sub("", reason))
        self._state, changed_state = (state, reason), state != self._state[0]
        if not state or kind == self._logged:
            return
        self._logged = kind
        level, word, color = _STATES.get(state, (INFO, state.capitalize(), palette.BOUND))
        if changed_state or state not in ("TRACKING", "RECOVERED"):
            yield log_line(stamp, level, f"{word}: {reason}" if reason else word, color)

    def loop(self, loop: Loop) -> Iterator[EntityUpdate]:
        """Yield a line for an accepted loop, and for refused ones at most once in 5 s."""
        apart = to_seconds(Stamp(loop.stamp - loop.candidate_stamp))
        what = f"with the place {apart:.1f} s before, {loop.inliers} inliers: {loop.reason}"
        if loop.accepted:
            self._accepted += 1
            yield log_line(loop.stamp, INFO, f"Loop closed {what}", palette.LOOP_ACCEPTED)
            return
        self._refused += 1
        if self._last_refused is not None and loop.stamp - self._last_refused < _REFUSED_EVERY_NS:
            self._unlogged += 1
            return
        more = f" (and {self._unlogged} more)" if self._unlogged else ""
        self._last_refused, self._unlogged = loop.stamp, 0
        yield log_line(loop.stamp, DETAIL, f"Loop refused {what}{more}", palette.BOUND)

    def truth(self, stamp: Stamp, fit: TruthInMap, first: bool) -> Iterator[EntityUpdate]:
        """Yield a line when truth is aligned for the first time and when its calibration is found."""
        if first:
            text = f"Truth aligned over {fit.matched} poses: {1e3 * fit.ate_m:.1f} mm off so far"
            yield log_line(stamp, INFO, text, palette.TRUTH)
        if fit.calibrated is not None and not self._calibrated:
            self._calibrated = True
            ahead_ms = 1e3 * fit.calibrated.offset_s
            lever = 1e3 * float((fit.calibrated.T_body_camera[:3, 3] ** 2).sum()) ** 0.5
            yield log_line(
                stamp,
                INFO,
                f"Marker body found {lever:.0f} mm from the camera, its clock {ahead_ms:+.1f} ms ahead",
                palette.TRUTH,
            )

    def error(self, error: PoseError) -> None:
        """Remember the newest error."""
        self._error = error

    def summary(self, stamp: Stamp, fit: TruthInMap | None, has_truth: bool, way: Trajectory) -> EntityUpdate:
        """Return the table of the present state; `fit` is None while truth, if there is some, is not aligned yet."""
        state, reason = self._state
        rows = [("way", f"{way.length_m:.2f} m in {way.duration_s:.1f} s")]
        if fit is not None:
            rows.append(("off truth (ATE so far)", f"**{1e3 * fit.ate_m:.1f} mm**"))
        elif has_truth:
            rows.append(("off truth", "not aligned yet: move and turn the camera"))
        if self._error is not None:
            rows.append(("off truth now", f"{1e3 * self._error.position_m:.1f} mm, {self._error.rotation_deg:.2f} deg"))
        rows.append(("loops", f"{self._accepted} closed, {self._refused} refused"))
        for key, name, unit in (
            ("fps", "rate", " Hz"),
            ("processing_ms", "processing", " ms"),
            ("latency_ms", "latency", " ms"),
        ):
            if key in self._values:
                rows.append((name, f"{_one_decimal(self._values[key])}{unit}"))
        table = "\n".join(f"| {name} | {value} |" for name, value in rows)
        text = f"| **{state or 'waiting'}** | {reason if state else 'for the odometry'} |\n|---|---|\n{table}\n"
        return update(entities.SUMMARY, stamp, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))


def _one_decimal(number: str) -> str:
    try:
        return f"{float(number):.1f}"
    except ValueError:
        return number
