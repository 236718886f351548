"""A walk through the simulated building, and how it went: before and after the loop is closed at its start.

    python tests/map_file/building.py --rooms 92 --every 2

Of the odometry's process there is the drawing too, so that memory is that of both.
"""

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from odom.backend import Odometry, OdometrySettings, State
from odom.backend.estimate import Estimate
from odom.evaluation.report import evaluate
from odom.evaluation.trajectory import Trajectory
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.map_file.map_file import MapFile
from odom.service.startup import warm_up
from odom.wire import Topics
from sensors.arena import ArenaOptions
from sensors.arena.camera_path import make_walk
from sensors.arena.frames import frame
from sensors.arena.options import WALKING_M_S
from sensors.arena.ring import round_m

_SAVED_EVERY_S = 0.5
"""As `odom run` does."""


def rss_mb() -> float:
    """Memory of this process now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


def true_pose(options: ArenaOptions, stamp: int) -> Array:
    """Return T_world_camera at a stamp."""
    return make_walk(options).T_world_camera((stamp - options.start) * 1e-9)


def nees(estimate: Estimate, T_first_true: Array) -> float:
    """Return the normalised squared error of a published pose since the first frame, by its own covariance."""
    assert estimate.T_odom_camera is not None
    assert estimate.covariance is not None
    xi = se3.log(se3.inverse(estimate.T_odom_camera) @ T_first_true)
    return float(xi @ np.linalg.solve(estimate.covariance, xi))


@dataclass(frozen=True)
class Walked:
    """How a walk went. `closed_after_m` is how far past its start the loop was closed, None where it was not."""

    walked_m: float
    tracked: float
    segments: int
    keyframes: int
    closures: int
    closed_after_m: float | None
    ate_m: float
    ate_published_m: float
    nees_before: float
    """Mean over all poses as published, until the loop was closed."""
    cpu_ms_p99: tuple[float, ...]
    """Of the thread that frames pass through, in each tenth of the walk."""
    rss_mb_at_100_m: float
    rss_mb: list[float]


def walked(options: ArenaOptions, map_: Path | None = None) -> Walked:
    """Walk once round, in a map at the path `map_` if there is one; return how it went.

    Everything is compiled or loaded before, as in the service: the first frames' times count.
    """
    warm_up(OdometrySettings(), Topics())
    opened = None if map_ is None else MapFile(map_, is_written=True)
    settings = OdometrySettings()
    odometry = Odometry(options.camera, settings, None if opened is None else opened.begin(options.camera))
    estimates, took_ms, memory, closed, before = [], [], [], [], []
    lap_s = round_m(options.rooms) / WALKING_M_S
    first, saved_s, closures = None, 0.0, 0
    for index in range(0, options.frames, options.every):
        shown = frame(options, index).rgbd()
        begun = time.thread_time()
        estimate = odometry.process(shown)
        took_ms.append(1e3 * (time.thread_time() - begun))
        estimates.append((estimate.stamp, estimate.state, estimate.T_odom_camera))
        t = (estimate.stamp - options.start) * 1e-9
        if opened is not None and t - saved_s > _SAVED_EVERY_S:
            saved_s = t
            opened.put(odometry.take_map_changes())
        first = true_pose(options, estimate.stamp) if first is None else first
        loops = [loop for loop in estimate.loops if loop.accepted]
        closed += [
            (t, loop.candidate_stamp) for loop in loops if t - (loop.candidate_stamp - options.start) * 1e-9 > 60
        ]
        closures += len(loops)
        if estimate.T_odom_camera is not None and t > 1.0 and not closed:
            before.append((t, nees(estimate, se3.inverse(first) @ true_pose(options, estimate.stamp))))
        if index % (30 * 15) < options.every:
            memory.append((t, rss_mb()))
            print(f"{t:6.0f} s {estimate.state.name} {memory[-1][1]:.0f} MB {closures} closures", flush=True)
    final = [p for p in odometry.finish() if p.T_map_camera is not None]
    if opened is not None:
        opened.put(odometry.take_map_changes())
        opened.close()
    segments = np.array([p.segment for p in final])
    stamps = np.array([p.stamp for p in final], dtype=np.int64)
    truth = Trajectory(stamps, np.array([true_pose(options, s) for s in stamps.tolist()]))
    posed = [(stamp, T) for stamp, _, T in estimates if T is not None]
    published = Trajectory(np.array([s for s, _ in posed], dtype=np.int64), np.array([T for _, T in posed]))
    at_start = [t for t, _ in closed if t > 0.9 * lap_s]
    return Walked(
        WALKING_M_S * options.frames / 30,
        sum(state is State.TRACKING for _, state, _ in estimates) / len(estimates),
        len(set(segments.tolist())),
        len(odometry.map.keyframes),
        closures,
        (at_start[0] - lap_s) * WALKING_M_S if at_start else None,
        evaluate(Trajectory(stamps, np.array([p.T_map_camera for p in final]), segments), truth).ate_m,
        evaluate(published, truth).ate_m,
        float(np.mean([n for _, n in before])),
        tuple(float(np.quantile(tenth, 0.99)) for tenth in np.array_split(took_ms, 10)),
        next(m for t, m in memory if t * WALKING_M_S >= min(100.0, 0.5 * lap_s * WALKING_M_S)),
        [m for _, m in memory],
    )


def main() -> None:
    """Walk and print how it went."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rooms", type=int, default=92)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--visit", type=int, default=0)
    parser.add_argument("--half", action="store_true")
    parser.add_argument("--map", type=Path)
    given = parser.parse_args()
    options = ArenaOptions(rooms=given.rooms, every=given.every, visit=given.visit, half=given.half)
    print(walked(options, given.map))


if __name__ == "__main__":
    main()
