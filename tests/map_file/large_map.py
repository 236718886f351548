"""A map of many key frames, made up at the level of poses and landmarks, and what it costs to work in it.

    python tests/map_file/large_map.py make large.map --keyframes 10000
    python tests/map_file/large_map.py measure large.map

No camera has walked so far: poses are those of laps through a building with the drift that their registrations allow,
places are descriptors of the committed recording with bits turned over, patches are noise. So times and sizes are those
of a real map, accuracy is not.
"""

import argparse
import json
import time
from pathlib import Path

import cv2
import numpy as np
import psutil
from made_up_map import CAMERA

import odom
from odom.backend.estimate import LoopCandidate
from odom.backend.loop_closure.candidate import ConfirmedCandidate
from odom.backend.loop_closure.loop_closure import LoopCloser
from odom.backend.map.keyframe import FrameObservations
from odom.backend.map.map import Map
from odom.backend.map.memory import open_map, recall, take_changes
from odom.backend.map.pose_graph import Edge
from odom.backend.map.saved import MapChanges, SavedDetails, SavedKeyframe, SavedLandmarks
from odom.backend.odometry.unproven_sensor import unproven_sensor
from odom.backend.settings import OdometrySettings
from odom.backend.tracking.frame_tracker import FrameTracker
from odom.frame import Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.features.measurement import Measurements
from odom.frontend.features.place_descriptor import Place
from odom.frontend.matching.place_recognition import recognise
from odom.geometry import se3
from odom.geometry.arrays import Array, Image
from odom.map_file.map_file import MapFile
from odom.service.child_process import peak_rss_mb

LAP = 400
"""Key frames of a lap of 120 m."""
STEP = np.array([0.0, 0.0, 0.3, 0.0, 2.0 * np.pi / LAP, 0.0])
"""From key frame to key frame."""
SIGMA = np.repeat([1e-3, 3e-4], 3)
"""Of a registration, metres and radians."""
LOOP_EVERY = 4
"""Of so many key frames one was registered against the lap before, but not in the last lap."""
OWN, MEASURED = 70, 200
"""Landmarks that a key frame saw first, and that it measured."""
RECORDING = Path(__file__).parents[2] / "recordings" / "arena.mcap"


def looks() -> list[Image]:
    """ORB descriptors of the frames of the committed recording."""
    orb = cv2.ORB.create(nfeatures=1000, scaleFactor=1.4, fastThreshold=5)
    grey = [cv2.cvtColor(frame.color, cv2.COLOR_RGB2GRAY) for frame in odom.read_recording(RECORDING)]
    return [np.asarray(orb.detectAndCompute(image, None)[1], dtype=np.uint8) for image in grey[::2]]


def turned_over(described: Image, share: float, rng: np.random.Generator) -> Image:
    """The descriptors with a share of their bits turned over."""
    return described ^ np.packbits(rng.random((len(described), 256)) < share, axis=1)


def place(described: Image, number: int) -> Place:
    """What key frame `number` shows: like one of the frames, but not too like."""
    rng = np.random.default_rng([1, number])
    ours = turned_over(described, 0.15, rng)
    points = rng.uniform((-1.5, -1.0, 1.0), (1.5, 1.0, 4.0), (len(ours), 3))
    return Place(ours, points, np.tile(1e-4 * np.eye(3), (len(ours), 1, 1)))


def seen_again(shown: Place, rng: np.random.Generator) -> Place:
    """A place as a camera that stands elsewhere sees it: half of its features, and others."""
    n = len(shown.points) // 2
    T = se3.exp(0.1 * rng.normal(size=6))
    points = np.concatenate([se3.apply(T, shown.points[:n]), rng.uniform(1.0, 3.0, (n, 3))])
    others = rng.integers(0, 256, (n, 32), dtype=np.uint8)
    descriptors = np.concatenate([turned_over(shown.descriptors[:n], 0.05, rng), others])
    return Place(descriptors, points, np.tile(1e-4 * np.eye(3), (2 * n, 1, 1)))


def details(described: Image, number: int) -> SavedDetails:
    """What key frame `number` measured: its own landmarks and those of the ones before."""
    rng = np.random.default_rng([2, number])
    identities = np.arange(max(1, OWN * (number + 1) + 1 - MEASURED), OWN * (number + 1) + 1)
    n = len(identities)
    measured = Measurements(
        rng.normal(size=(n, 3)), rng.normal(size=(n, 3, 3)), rng.random((n, 4)), rng.normal(size=(n, 2))
    )
    patches = rng.integers(0, 256, (2, OWN, 25, 25), dtype=np.uint8)
    points = rng.uniform((-1.5, -1.0, 1.0), (1.5, 1.0, 4.0), (OWN, 3))
    landmarks = SavedLandmarks(
        identities[-OWN:], points, np.tile(1e-4 * np.eye(3), (OWN, 1, 1)), rng.random((OWN, 2)), rng.random((OWN, 3)),
        *patches, np.full(OWN, 5), np.full(OWN, 5), np.zeros(OWN, dtype=np.bool_),
    )  # fmt: skip
    return SavedDetails(ShutterTiming(), identities, rng.random((n, 2)), measured, landmarks, place(described, number))


def make(path: Path, keyframes: int) -> None:
    """Make the map."""
    opened, seen, rng = MapFile(path, is_written=True), looks(), np.random.default_rng(0)
    opened.begin(CAMERA)
    covariance, true, T = np.diag(SIGMA**2), np.eye(4), np.eye(4)
    of_lap: list[Array] = []
    for number in range(keyframes):
        edges = []
        if number:
            step = se3.exp(STEP) @ se3.exp(SIGMA * rng.normal(size=6))
            true, T = true @ se3.exp(STEP), T @ step
            edges.append(Edge(number - 1, number, step, covariance))
        of_lap.append(true)
        if LAP <= number < keyframes - LAP and number % LOOP_EVERY == 0:
            T_loop = se3.inverse(of_lap[number - LAP]) @ true @ se3.exp(SIGMA * rng.normal(size=6))
            edges.append(Edge(number - LAP, number, T_loop, covariance, is_loop=True))
        links = tuple(range(max(0, number - 4), number))
        keyframe = SavedKeyframe(
            number, 0, Stamp(10**9 * (1 + number)), 0, 0, se3.inverse(T), np.eye(4), 1e-4 * np.eye(6), links
        )
        told = details(seen[number % len(seen)], number)
        opened.put(MapChanges((keyframe,), tuple(edges), {number: told}, OWN * (number + 1) + 1))
        if number % 100 == 99:
            opened.flush()
    opened.close()


FIRST, REST, CLOSURES = 1000, 100, 5
"""Number of the first frame, frames between closures, and how many loops are closed."""


def found(map_: Map, a: int, b: int) -> ConfirmedCandidate:
    """A closure that geometry has confirmed: b stands where a lap of no drift has it."""
    keyframes = map_.keyframes
    covariance = np.diag(SIGMA**2)
    T_a_b = se3.exp(STEP * 0.0) if (b - a) % LAP == 0 else se3.exp(STEP * ((b - a) % LAP))
    candidate = LoopCandidate(keyframes[b].stamp, keyframes[a].stamp, 100, True, "made up", T_a_b)
    none = np.zeros(0, dtype=np.int64)
    nothing = FrameObservations(rows=none, identities=none, measurements=Measurements.nothing(), timing=ShutterTiming())
    return ConfirmedCandidate(candidate, Edge(a, b, T_a_b, covariance, is_loop=True), np.zeros((0, 2)), nothing)


def measure(path: Path, queries: int = 50) -> dict[str, float]:
    """Return what it costs to open a map, to recognise places in it, and to close a loop over all of it."""
    begun = time.process_time()
    opened = MapFile(path, is_written=True)
    map_ = open_map(opened.begin(CAMERA))
    out = {"keyframes": float(len(map_.keyframes)), "open_s": time.process_time() - begun}
    out["file_mb_a_keyframe"] = path.stat().st_size / 1e6 / len(map_.keyframes)
    rng = np.random.default_rng(3)
    chosen = rng.choice(len(map_.keyframes) - LAP, queries, replace=False).tolist()
    asked = [seen_again(shown, rng) for n in chosen if (shown := map_.places.place_of(n)) is not None]
    recognise(map_.places, asked[0], set())  # compiles
    took, right = [], 0
    for number, one in zip(chosen, asked, strict=True):
        begun = time.thread_time()
        first = recognise(map_.places, one, set())
        took.append(time.thread_time() - begun)
        right += any(r.candidate == number and not r.refusal for r in first)
    out |= {"recognised": right / queries, "query_ms": 1e3 * float(np.median(took))}
    out |= close_over_all(map_, opened)
    out["rss_mb"] = peak_rss_mb(psutil.Process())
    opened.close()
    return out


def close_over_all(map_: Map, opened: MapFile) -> dict[str, float]:
    """Close the last lap, whose drift moves all of it, while frames go by; return what that takes of them.

    What the frame of a closure does is measured several times, in CPU time of its thread: by the least and the median.
    """
    newest = len(map_.keyframes) - 1
    recall(map_, range(newest + 1 - LAP, newest + 1))
    sensor = unproven_sensor(CAMERA, OdometrySettings()).with_stamp(Stamp(10**9))
    closer = LoopCloser(map_, FrameTracker(map_, OdometrySettings()))
    closer._closing._waiting = [found(map_, n - LAP, n) for n in (newest - 300, newest)]
    closer.close(None, sensor)  # compiles
    take_changes(map_)
    opened.flush()
    idle = [gap for _ in range(REST) for gap in gaps_of_a_frame()]
    count, spent, saving, after, gaps = FIRST, [], [], [], []
    for k in range(CLOSURES):
        closer._closing._waiting = [found(map_, newest - LAP - 50 - k, newest - 50 - k)]
        begun_at, on_frame, is_closed = count, [], False
        while not is_closed:
            sensor = sensor.with_stamp(Stamp(10**9 + count * 33_333_333))
            begun = time.thread_time()
            is_closed = any(one.accepted for one in closer.close(count, sensor))
            closer.work_on_waiting(count + 1, sensor, has_time=True)
            on_frame.append(time.thread_time() - begun)
            gaps += gaps_of_a_frame()
            count += 1
        after.append((count - 1 - begun_at) / 30)
        spent.append(max(on_frame))
        begun = time.thread_time()
        opened.put(take_changes(map_))
        saving.append(time.thread_time() - begun)
        count += REST
    return {
        "closed_after_s": max(after),
        "least_frame_ms": 1e3 * min(spent),
        "median_frame_ms": 1e3 * float(np.median(spent)),
        "saving_ms": 1e3 * float(np.median(saving)),
        "gap_p999_ms": 1e3 * float(np.quantile(gaps, 0.999)),
        "gap_p999_idle_ms": 1e3 * float(np.quantile(idle, 0.999)),
    }


def gaps_of_a_frame() -> list[float]:
    """Work for the time of a frame in steps as short as its own; return how long each took."""
    gaps, begun = [], time.perf_counter()
    while time.perf_counter() - begun < 1 / 30:
        step = time.perf_counter()
        sum(range(2000))
        gaps.append(time.perf_counter() - step)
    return gaps


def main() -> None:
    """Make a map, or print what it costs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("make", "measure"))
    parser.add_argument("map", type=Path)
    parser.add_argument("--keyframes", type=int, default=10_000)
    given = parser.parse_args()
    if given.what == "make":
        make(given.map, given.keyframes)
    else:
        print(json.dumps(measure(given.map)))


if __name__ == "__main__":
    main()
