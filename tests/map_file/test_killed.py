"""Killed at any moment, a process leaves a map that opens, holds what was written, and lacks no more than promised."""

import multiprocessing
import time
from dataclasses import astuple, dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import made_up_map
import numpy as np
import pytest
from made_up_map import CAMERA

from odom.errors import ConfigError
from odom.map_file.map_file import MapFile

pytestmark = pytest.mark.process

PRELOADED = ["pytest", "odom.backend", "odom.map_file.map_file"]
"""What this module and the made-up map import: loaded once for all that are killed."""
PERIOD_S = 0.01
"""Between two key frames: fifty times as many as a camera makes."""
SESSION = 40
"""Key frames after which the map is closed and opened again."""
PROMISED_S = 1.0
"""What may be missing."""


def write_until_killed(path: Path, number: int, to_test: Connection) -> None:
    """Add key frames from `number` on, session by session; tell which were put, when, and which were waited for."""
    to_test.send((-1, time.monotonic(), False))
    while True:
        opened = MapFile(path, is_written=True)
        opened.begin(CAMERA)
        for _ in range(SESSION):
            opened.put(made_up_map.changes(number))
            to_test.send((number, time.monotonic(), False))
            if number % 7 == 0:
                opened.flush()
                to_test.send((number, time.monotonic(), True))
            number += 1
            time.sleep(PERIOD_S)
        opened.close()


@dataclass(frozen=True)
class Told:
    """The last key frame that must be there: it was waited for, or put more than the promised time before the end."""

    waited_for: int = -1
    promised: int = -1
    put: int = -1


def killed(path: Path, number: int, after_s: float) -> Told:
    """Write to a map in a process that is killed `after_s` it opens the map; return what it had told."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=write_until_killed, args=(path, number, theirs), daemon=True)
    process.start()
    theirs.close()
    ours.poll(60.0)  # what comes before it opens the map takes a time of its own
    time.sleep(after_s)
    process.kill()
    end = time.monotonic()
    process.join()
    told = Told()
    while ours.poll():
        try:
            at, moment, is_waited_for = ours.recv()
        except EOFError:
            break
        promised = at if end - moment > PROMISED_S else -1
        told = Told(*np.maximum(astuple(told), (at if is_waited_for else -1, promised, at)).tolist())
    return told


def check(path: Path, told: Told) -> int:
    """Open a map as the odometry does and compare all of it with what was put; return its key frames."""
    opened = MapFile(path, is_written=False)
    try:
        saved = opened.begin(CAMERA)
        count = len(saved.keyframes)
        assert max(told.waited_for, told.promised) < count
        for k, edge in zip(saved.keyframes[1:], saved.edges, strict=True):
            assert (edge.a, edge.b) == (k.number - 1, k.number)
        for k in saved.keyframes:
            expected, details = made_up_map.keyframe(k.number), made_up_map.details(k.number)
            assert (k.stamp, k.links) == (expected.stamp, expected.links)
            np.testing.assert_array_equal(k.T_camera_map, expected.T_camera_map)
            found, place = opened.fetch(k.number), opened.fetch_place(k.number)
            assert found is not None
            np.testing.assert_array_equal(found.landmarks.patch_full, details.landmarks.patch_full)
            assert place is not None
            np.testing.assert_array_equal(place.descriptors, details.place.descriptors)
    finally:
        opened.close()
    return count


def kill_often(folder: Path, times: int, longest_s: float, seed: int) -> list[int]:
    """Kill writers at random moments, every tenth in a new map; return how many key frames each kill left."""
    rng, left = np.random.default_rng(seed), [0]
    for k in range(times):
        path = folder / f"{k // 10}.map"
        told = killed(path, left[-1] if k % 10 else 0, rng.uniform(0.0, longest_s))
        left.append(check(path, told))
    return left


def test_a_map_opens_after_some_kills_and_goes_on(tmp_path):
    left = kill_often(tmp_path, times=8, longest_s=0.6, seed=1)
    assert left == sorted(left)
    assert left[-1] > SESSION


def test_killed_while_it_is_made_a_map_is_there_or_not(tmp_path):
    rng, seen = np.random.default_rng(3), set[bool]()
    for k in range(30):
        path = tmp_path / f"{k}.map"
        told = killed(path, 0, rng.uniform(0.0, 0.05))
        said = ""
        try:
            check(path, told)
        except ConfigError as error:
            said = str(error)
        assert not said or ("there is no map" in said and told.waited_for < 0)
        seen.add(bool(said))
        opened = MapFile(path, is_written=True)
        opened.begin(CAMERA)
        opened.close()
    assert False in seen


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_two_hundred_kills_cost_no_map_more_than_the_last_second(tmp_path):
    left = kill_often(tmp_path, times=200, longest_s=2.0, seed=2)
    assert len(left) == 201
    assert max(left) > 10 * SESSION
