"""`odom batch` as its users meet it: real runs in processes of their own, some of them killed."""

import json
import os
import random
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest

PROJECT = Path(__file__).parents[2]
RECORDING = PROJECT / "recordings" / "arena.mcap"
TABLES = ("summary.csv", "summary.json", "summary.html")


def odom(*arguments, **environment):
    return subprocess.Popen(
        [sys.executable, "-m", "odom", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=PROJECT,
        env={**os.environ, **environment},
    )


def finished(process, status=0, timeout=3000):
    try:
        words, _ = process.communicate(timeout=timeout)
    finally:
        process.kill()  # and its runs end with it
    assert process.returncode == status, words
    return words


def cut(folder, count, seconds, apart):
    """Short recordings, pieces of the arena's."""
    folder.mkdir()
    for i in range(count):
        begin = 1.0 + i * apart
        file = folder / f"piece-{i:02}.mcap"
        finished(odom("import", RECORDING, file, "--start", begin, "--end", begin + seconds))
    return folder


def runs_of(process):
    """The `odom run` processes below a process."""
    found = []
    for child in psutil.Process(process.pid).children(recursive=True):
        try:
            if child.cmdline()[1:4] == ["-m", "odom", "run"]:
                found.append(child)
        except psutil.Error:
            continue
    return found


def kill_now_and_then(victims, running, times, pause_s, seed):
    """Kill one of `victims()` every few seconds, `times` at the most, while `running()`; return a thread that does."""
    chance = random.Random(seed)
    killed = []

    def kill():
        while running() and len(killed) < times:
            time.sleep(chance.uniform(0.3, 1.0) * pause_s)
            try:
                found = victims()
                if found:
                    victim = chance.choice(found)
                    victim.kill()
                    killed.append(victim.pid)
            except (psutil.Error, OSError):
                continue

    thread = threading.Thread(target=kill, daemon=True)
    thread.killed = killed
    thread.start()
    return thread


def tables(out):
    return {name: (out / name).read_bytes() for name in TABLES}


@pytest.mark.long
def test_a_killed_run_starts_again_and_what_is_done_is_not_done_again(tmp_path):
    recordings, out = cut(tmp_path / "pieces", 1, 1.2, 3.0), tmp_path / "out"
    assert "0 of 0 recordings done" in finished(odom("batch", recordings, "--out", out, "--shard", "1/2"))
    assert not (out / "summary.csv").exists()
    first = odom("batch", recordings, "--out", out)
    killer = kill_now_and_then(lambda: runs_of(first), lambda: first.poll() is None, 1, 2.0, seed=1)
    assert "1 of 1 recordings done, 1 of them were due" in finished(first)
    assert len(killer.killed) == 1
    kept = tables(out)
    assert len(list((out / "results").iterdir())) == 1  # nothing is left of the killed one
    (row,) = json.loads(kept["summary.json"])["recordings"]
    assert (row["name"], row["state"]) == ("piece-00", "done")
    assert row["frames"] == row["tracked"] > 5
    assert "0 of them were due" in finished(odom("batch", recordings, "--out", out))
    assert tables(out) == kept
    (row_again,) = json.loads(_against(recordings, out, tmp_path / "baseline", kept))["recordings"]
    assert row_again["change"] == "same"


@pytest.mark.long
def test_a_recording_that_was_cut_is_done_and_said_to_be_cut(tmp_path):
    recordings, out = cut(tmp_path / "pieces", 1, 1.2, 3.0), tmp_path / "out"
    (piece,) = recordings.iterdir()
    piece.write_bytes(piece.read_bytes()[: piece.stat().st_size * 2 // 3])
    for _ in range(2):
        words = finished(odom("batch", recordings, "--out", out))
        assert "piece-00: done, but its source is damaged: cut at byte" in words
    (row,) = json.loads((out / "summary.json").read_text())["recordings"]
    assert row["state"] == "done"
    assert row["source_damage"].startswith("cut at byte")


def _against(recordings, out, baseline, kept):
    """The summary of a batch against a baseline of its own."""
    baseline.mkdir()
    (baseline / "summary.json").write_bytes(kept["summary.json"])
    finished(odom("batch", recordings, "--out", out, "--baseline", baseline))
    return (out / "summary.json").read_text()


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_a_recording_that_fails_is_named_and_tried_again(tmp_path):
    recordings, out = cut(tmp_path / "pieces", 1, 1.2, 3.0), tmp_path / "out"
    (recordings / "spoilt.mcap").write_bytes(b"no recording")
    for due in (2, 1):
        words = finished(odom("batch", recordings, "--out", out), status=1)
        assert f"1 of 2 recordings done, {due} of them were due" in words
        assert "spoilt: failed:" in words


@pytest.mark.slow
@pytest.mark.timeout(5400)
def test_sixty_recordings_by_killed_processes_and_by_a_killed_cluster_equal_one_after_another(tmp_path):
    distributed = pytest.importorskip("distributed", reason="pip install 'rgbd-odom[fleet]'")
    recordings = cut(tmp_path / "pieces", 60, 1.6, 0.45)
    finished(odom("batch", recordings, "--out", tmp_path / "single", "--jobs", 1))
    expected = tables(tmp_path / "single")

    many = odom("batch", recordings, "--out", tmp_path / "many", "--jobs", 4)
    killer = kill_now_and_then(lambda: runs_of(many), lambda: many.poll() is None, 15, 12.0, seed=2)
    finished(many)
    assert len(killer.killed) > 5
    assert tables(tmp_path / "many") == expected

    with (
        distributed.LocalCluster(n_workers=4, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):

        def workers():
            return [psutil.Process(pid) for pid in client.run(os.getpid).values()]

        spread = odom("batch", recordings, "--out", tmp_path / "spread", "--dask", cluster.scheduler_address)
        killer = kill_now_and_then(workers, lambda: spread.poll() is None, 8, 25.0, seed=3)
        finished(spread)
        assert len(killer.killed) > 3
    assert tables(tmp_path / "spread") == expected

    took_s = []
    for _ in range(3):  # the cluster may still be ending during the first
        begun = time.monotonic()
        words = finished(odom("batch", recordings, "--out", tmp_path / "many"))
        took_s.append(time.monotonic() - begun)
        assert "60 of 60 recordings done, 0 of them were due" in words
    print(f"calls that find all done: {', '.join(f'{each:.2f}' for each in took_s)} s")
    assert min(took_s) <= 2.0
    assert tables(tmp_path / "many") == expected


def test_wrong_calls_are_refused(tmp_path):
    pieces, out = tmp_path / "pieces", tmp_path / "out"
    pieces.mkdir()
    (pieces / "a.mcap").write_bytes(b"never read")
    assert "0 to n - 1" in finished(odom("batch", pieces, "--out", out, "--shard", "2/2"), status=2)
    assert "--jobs" in finished(odom("batch", pieces, "--out", out, "--dask", "tcp://x:1", "--jobs", "2"), status=2)
    assert not out.exists()


def test_an_interrupted_batch_is_a_failure(tmp_path):
    recordings, out = tmp_path / "pieces", tmp_path / "out"
    recordings.mkdir()
    for i in range(3):
        (recordings / f"{i}.mcap").symlink_to(RECORDING)
    first = odom("batch", recordings, "--out", out, "--jobs", "1")
    deadline = time.monotonic() + 60
    while not runs_of(first) and time.monotonic() < deadline:
        time.sleep(0.05)
    first.terminate()
    assert "recordings are not done; the next call does them" in finished(first, status=1, timeout=120)


def test_an_interruption_while_recordings_are_hashed_ends_it_and_keeps_the_hashes(tmp_path):
    recordings, out = tmp_path / "pieces", tmp_path / "out"
    recordings.mkdir()
    (recordings / "a.mcap").symlink_to(RECORDING)
    with (recordings / "z.mcap").open("wb") as file:
        file.truncate(200 << 30)  # a file of holes: it takes no room, but minutes to read
    batch = odom("batch", recordings, "--out", out)
    deadline = time.monotonic() + 60
    while not (out / "results").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(2.0)
    batch.terminate()
    assert "stopped while the recordings were hashed" in finished(batch, status=1, timeout=20)
    assert len(json.loads((out / "hashes.json").read_text())) == 1
