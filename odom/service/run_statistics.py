"""Counters and measurements of a run, in memory that does not grow with its length."""

import logging
import math
import time
from collections import Counter, deque
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np
import psutil

from odom.backend import Estimate, LoopCandidate, State
from odom.frame import RgbdFrame
from odom.service.input_report import completeness
from odom.wire.image_counts import NOT_TRACKABLE, ImageCounts

_LOG = logging.getLogger(__name__)
_LOWEST_MS = 0.01
"""Lower edge of the histogram of durations; what is shorter counts as this."""
_STEP = math.log(1.01)
"""Width of a bin: quantiles are right to 1 %. Half as wide takes twice the bins."""
_BINS = 1700
"""Up to 200 s; longer durations count in the last bin."""
_RECENT = 60
"""Frames over which the rate and the offset of the stamps are measured, 2 s: with fewer they jump, with more they
lag."""
_COUNTERS = (
    "keyframes", "forgotten_keyframes", "forgotten_frames", "loop_candidates", "loop_closures", "lost_frames",
    "unmatched_frames", "unwritten",
)  # fmt: skip
"""Fields that a status and the report hold under their own names."""


class Durations:
    """Mean, quantiles (to 1 %) and number of durations between 10 microseconds and 200 s."""

    def __init__(self) -> None:
        self._counts = np.zeros(_BINS, dtype=np.int64)
        self._sum = 0.0

    def add(self, milliseconds: float) -> None:
        """Count one duration."""
        index = int(math.log(max(milliseconds, _LOWEST_MS) / _LOWEST_MS) / _STEP)
        self._counts[min(index, _BINS - 1)] += 1
        self._sum += milliseconds

    def __len__(self) -> int:
        return int(self._counts.sum())

    @property
    def mean(self) -> float | None:
        """Mean in milliseconds, None without any."""
        return self._sum / len(self) if len(self) else None

    def quantile(self, share: float) -> float | None:
        """Return the duration (ms) below which `share` of them lie, None without any."""
        if not len(self):
            return None
        index = int(np.searchsorted(np.cumsum(self._counts), share * len(self)))
        return _LOWEST_MS * math.exp(_STEP * (index + 0.5))

    def summary(self, with_mean: bool) -> dict[str, float | None]:
        """Return the entries of the report: p50, p95, p99 and the mean if asked for."""
        out = {"mean": _rounded(self.mean)} if with_mean else {}
        return out | {f"p{share}": _rounded(self.quantile(share / 100)) for share in (50, 95, 99)}


@dataclass
class RunStatistics:
    """Counters of one odometry process.

    `color` and `depth` count what became of the images before they reached the odometry, `refused` counts the frames
    that it did not take, `lost_for` those that are LOST, by reason; `chain_holes` those with a pose that the chain
    could not link to an earlier one; `dropped` counts all bad input by its kind, `forgotten_*` what the odometry gave
    up to stay within its memory, `unwritten_lines` lines and files that could not be written, `unwritten_changes` those
    of the map that are not on disk by now; `source_end` is what the source said when it ended.
    """

    processing: Durations = field(default_factory=Durations)
    latency: Durations = field(default_factory=Durations)
    stages_ms: dict[str, float] = field(default_factory=dict)
    states: Counter[State] = field(default_factory=Counter)
    lost_for: Counter[str] = field(default_factory=Counter)
    dropped: Mapping[str, int] = field(default_factory=dict)
    color: ImageCounts = field(default_factory=ImageCounts)
    depth: ImageCounts = field(default_factory=ImageCounts)
    offset_ms: deque[float] = field(default_factory=lambda: deque(maxlen=_RECENT))
    ends: deque[float] = field(default_factory=lambda: deque(maxlen=_RECENT))
    frames: int = 0
    keyframes: int = 0
    forgotten_keyframes: int = 0
    forgotten_frames: int = 0
    loop_candidates: int = 0
    loop_closures: int = 0
    segments_begun: int = 0
    chain_links: int = 0
    chain_holes: int = 0
    refused: int = 0
    lost_frames: int = 0
    unmatched_frames: int = 0
    unwritten_lines: int = 0
    unwritten_changes: int = 0
    source_end: str | None = None
    _begun: tuple[float, float] | None = None
    _ended: tuple[float, float] = (0.0, 0.0)

    def begin(self) -> None:
        """Start the clocks with the first frame received."""
        if self._begun is None:
            self._begun = (time.perf_counter(), time.process_time())

    def note_forgotten(self, keyframes: int, frames: int, most: int) -> None:
        """Count what the odometry forgot; the first time is logged, `most` being the key frames remembered."""
        if keyframes and not self.forgotten_keyframes:
            _LOG.info("the map holds %d key frames: from now on the oldest are forgotten, and counted", most)
        if frames and not self.forgotten_frames:
            _LOG.warning("too long for one trajectory.txt: the oldest frames are dropped from it, and counted")
        self.forgotten_keyframes, self.forgotten_frames = keyframes, frames

    def add_loops(self, loops: Collection[LoopCandidate]) -> None:
        """Count loop candidates."""
        self.loop_candidates += len(loops)
        self.loop_closures += sum(loop.accepted for loop in loops)

    def add(self, estimate: Estimate, frame: RgbdFrame, processing_ms: float) -> None:
        """Count one processed frame."""
        self.frames += 1
        self.offset_ms.append((frame.depth_stamp - frame.stamp) * 1e-6)
        self.states[estimate.state] += 1
        if estimate.state is State.LOST:
            self.lost_for[estimate.reason] += 1
        self.keyframes += estimate.is_keyframe
        self.add_loops(estimate.loops)
        if estimate.T_odom_camera is not None:
            self.segments_begun = max(self.segments_begun, estimate.segment + 1)
        self.chain_links += estimate.pairwise is not None
        self.chain_holes += estimate.chain is not None and estimate.chain.hole != ""
        self.processing.add(processing_ms)
        for stage, milliseconds in estimate.timings_ms.items():
            self.stages_ms[stage] = self.stages_ms.get(stage, 0.0) + milliseconds
        self._ended = (time.perf_counter(), time.process_time())
        self.ends.append(self._ended[0])

    @property
    def tracked(self) -> int:
        """Frames with a pose that may be trusted."""
        return sum(count for state, count in self.states.items() if state.is_trusted)

    @property
    def tracked_share(self) -> float:
        """The share of them among the frames processed, 0 without any."""
        return self.tracked / max(self.frames, 1)

    @property
    def unwritten(self) -> int:
        """Lines, files and changes of the map that could not be written, and are missing."""
        return self.unwritten_lines + self.unwritten_changes

    @property
    def wall_s(self) -> float:
        """Seconds from the first frame received to the last one processed."""
        return max(self._ended[0] - self._begun[0], 0.0) if self._begun and self.frames else 0.0

    @property
    def cpu_ms_per_frame(self) -> float | None:
        """CPU time of all threads of the process over the same span, per processed frame."""
        return 1e3 * (self._ended[1] - self._begun[1]) / self.frames if self._begun and self.frames else None

    @property
    def recent_fps(self) -> float:
        """Frames per second over the last 60 frames."""
        span = self.ends[-1] - self.ends[0] if len(self.ends) > 1 else 0.0
        return (len(self.ends) - 1) / span if span else 0.0

    def status(self) -> dict[str, str]:
        """Return the values of a status message."""
        values: dict[str, float | int | None] = {
            "frames": self.frames,
            "tracked": self.tracked,
            "fps": round(self.recent_fps, 1),
            "processing_ms": _rounded(self.processing.quantile(0.5)),
            "processing_p99_ms": _rounded(self.processing.quantile(0.99)),
            "latency_ms": _rounded(self.latency.quantile(0.5)),
            "latency_p99_ms": _rounded(self.latency.quantile(0.99)),
            "cpu_ms_per_frame": _rounded(self.cpu_ms_per_frame),
            "rss_mb": round(psutil.Process().memory_info().rss / 2**20, 1),
            "sync_offset_ms": _rounded(float(np.median(self.offset_ms)) if self.offset_ms else None),
            "sync_spread_ms": _rounded(float(np.ptp(self.offset_ms)) if self.offset_ms else None),
            "dropped": sum(self.dropped.values()),
        }
        values |= {name: getattr(self, name) for name in _COUNTERS}
        return {name: str(value) for name, value in values.items() if value is not None}

    def _color_used(self) -> ImageCounts:
        refused = Counter({NOT_TRACKABLE: self.refused} if self.refused else {})
        return ImageCounts(self.color.given, self.frames, self.color.refused + refused)

    def report(self) -> dict[str, object]:
        """Return the odometry's entries of report.json; what was not measured is None."""
        return {
            "frames": self.frames,
            "tracked": self.tracked,
            "completeness": completeness(self.tracked, self.color.given),
            "colour": self._color_used().report(),
            "depth": self.depth.report(),
            "segments_begun": self.segments_begun,
            "chain": {"links": self.chain_links, "holes": self.chain_holes},
            "source_end": self.source_end,
            **{name: getattr(self, name) for name in _COUNTERS},
            "processing_ms": self.processing.summary(with_mean=True),
            "latency_ms": self.latency.summary(with_mean=False),
            "cpu_ms_per_frame": _rounded(self.cpu_ms_per_frame),
            "wall_s": _rounded(self.wall_s),
            "fps": _rounded(self.frames / self.wall_s if self.wall_s else None),
            "lost_for": dict(self.lost_for),
            "states": {state.value: self.states[state] for state in State},
            "stages_ms": {stage: _rounded(total / self.frames) for stage, total in self.stages_ms.items()},
            "dropped": dict(self.dropped),
        }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 4)
