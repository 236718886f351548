"""What a frame costs, stage by stage: decoding and odometry over a whole source, in one process and without a wire."""

import threading
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from odom.backend import Odometry, OdometrySettings
from odom.bench.corner_following import CornerFollowing
from odom.errors import SourceError
from odom.wire import Topics
from odom.wire.assembler import FrameAssembler
from sensors.source import Source

DECODE, ODOMETRY, TOTAL = "decode", "odometry", "total"
_BACKGROUND = "odom-"
"""How the names of the background threads begin."""


@dataclass(frozen=True)
class StageCost:
    """Wall milliseconds a frame of one stage, over all frames: one that did not pass through it counts 0."""

    stage: str
    mean_ms: float
    p50_ms: float
    p95_ms: float
    p99_ms: float
    each_ms: tuple[float, ...]

    @classmethod
    def of(cls, stage: str, milliseconds: Sequence[float]) -> "StageCost":
        """Return the cost of a stage from its time in each frame."""
        p50, p95, p99 = np.percentile(milliseconds, (50, 95, 99))
        return cls(stage, float(np.mean(milliseconds)), float(p50), float(p95), float(p99), tuple(milliseconds))


@dataclass(frozen=True)
class PipelineCost:
    """`stages` in the order they run: `decode`, those of the odometry, then `odometry` as a whole and `total`.

    `cpu_ms_a_frame` is CPU time of decoding, odometry and its background threads together, `background_ms_a_frame` of
    the latter alone; the source's own work (reading, drawing) is not in any figure. `finish_s` is the final adjustment.
    `stamps_ns` are the frames'. `follow_ms` is what following corners from one image to the next takes on this machine,
    `floor_ms` that and decoding: no odometry can process these frames for less (see `corner_following.py`).
    """

    frames: int
    frames_a_second: float
    cpu_ms_a_frame: float
    background_ms_a_frame: float
    finish_s: float
    stages: tuple[StageCost, ...]
    stamps_ns: tuple[int, ...]
    follow_ms: float | None

    @property
    def floor_ms(self) -> float | None:
        """Milliseconds a frame of decoding it and following its corners; None where no image had a corner."""
        if self.follow_ms is None:
            return None
        return self.follow_ms + next(stage.mean_ms for stage in self.stages if stage.stage == DECODE)


def measure_pipeline(
    source: Source,
    topics: Topics,
    settings: OdometrySettings,
    frames: int | None = None,
    progress: Callable[[int], None] = lambda frames: None,
    stopped: Callable[[], bool] = lambda: False,
) -> PipelineCost:
    """Return what up to `frames` frames of `source` cost, or of those before `stopped` is true.

    `progress` is called with the number measured. Raises SourceError when there was no frame with a calibration.
    """
    assembler = FrameAssembler(topics, grey=True)
    odometry: Odometry | None = None
    laps: list[dict[str, float]] = []
    stamps_ns: list[int] = []
    following = CornerFollowing()
    decode_s = cpu_s = 0.0
    messages = source.messages()
    try:
        ended = False
        while not (ended or stopped()) and (frames is None or len(laps) < frames):
            message = next(messages, None)
            ended = message is None
            begun, cpu_begun = time.perf_counter(), time.thread_time()
            complete = assembler.finish() if message is None else assembler.feed(message)
            decode_s += time.perf_counter() - begun
            cpu_s += time.thread_time() - cpu_begun
            for frame in complete:
                if assembler.camera is None or (frames is not None and len(laps) >= frames):
                    continue
                if odometry is None:
                    odometry = Odometry(assembler.camera, settings)
                begun, cpu_begun = time.perf_counter(), time.thread_time()
                estimate = odometry.process(frame)
                took_ms = 1e3 * (time.perf_counter() - begun)
                cpu_s += time.thread_time() - cpu_begun
                decode_ms, decode_s = 1e3 * decode_s, 0.0
                laps.append({DECODE: decode_ms, **estimate.timings_ms, ODOMETRY: took_ms, TOTAL: decode_ms + took_ms})
                stamps_ns.append(int(frame.stamp))
                following.see(frame.color)
                progress(len(laps))
    finally:
        source.close()
    if odometry is None:
        if stopped():
            raise SourceError("interrupted before the first frame: nothing was measured")
        raise SourceError("the source holds no frame with a calibration: look at it with `odom info`")
    background_s = _background_cpu_s()
    begun = time.perf_counter()
    odometry.finish()
    finish_s = time.perf_counter() - begun
    n = len(laps)
    wall_ms = sum(lap[TOTAL] for lap in laps)
    return PipelineCost(
        frames=n,
        frames_a_second=1e3 * n / wall_ms,
        cpu_ms_a_frame=1e3 * (cpu_s + background_s) / n,
        background_ms_a_frame=1e3 * background_s / n,
        finish_s=finish_s,
        stages=_stages(laps),
        stamps_ns=tuple(stamps_ns),
        follow_ms=following.median_ms,
    )


def _background_cpu_s() -> float:
    """Return the CPU seconds of the odometry's background threads so far."""
    names = [t for t in threading.enumerate() if t.name.startswith(_BACKGROUND) and t.ident is not None]
    return sum(time.clock_gettime(time.pthread_getcpuclockid(t.ident)) for t in names if t.ident is not None)


def _stages(laps: list[dict[str, float]]) -> tuple[StageCost, ...]:
    position: dict[str, list[float]] = defaultdict(list)
    for lap in laps:
        for place, stage in enumerate(lap):
            position[stage].append(place / len(lap))
    ordered = sorted(position, key=lambda stage: float(np.mean(position[stage])))
    return tuple(StageCost.of(stage, [lap.get(stage, 0.0) for lap in laps]) for stage in ordered)
