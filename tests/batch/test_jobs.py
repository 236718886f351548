"""What a batch does, and what it need not do again."""

import json
import os
from pathlib import Path

import pytest

from odom.batch.content_hashes import ContentHashes
from odom.batch.job import Job, plan_jobs, shard_of
from odom.batch.recordings import Recording, find_recordings
from odom.errors import ConfigError, OdomError, SourceError


@pytest.fixture
def folder(tmp_path):
    """A folder of recordings as far as their names tell."""
    names = ("b.mcap", "deep/a.mcap", "desk/rgb.txt", "desk/rgb/1.png", "bag/metadata.yaml", "bag/0.mcap", "notes.txt")
    for name in names:
        path = tmp_path / "walks" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    return tmp_path / "walks"


def plan(recordings, out, odometry=None, arguments=()):
    return plan_jobs(recordings, ContentHashes(out), odometry or {}, arguments, out / "results")


def test_recordings_are_found_in_folders_and_named_by_their_way(folder):
    assert [r.name for r in find_recordings([folder])] == ["b", "bag", "deep/a", "desk"]
    assert [r.name for r in find_recordings([folder / "b.mcap", folder / "desk"])] == ["b", "desk"]


def test_bags_of_ros_are_found_as_files_and_folders(tmp_path):
    for name in ("one.bag", "Two.BAG", "loose/0.db3", "loose/1.db3", "whole/metadata.yaml", "whole/0.db3", "c.txt"):
        path = tmp_path / "bags" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    assert [r.name for r in find_recordings([tmp_path / "bags"])] == ["Two.BAG", "loose", "one.bag", "whole"]
    assert [r.name for r in find_recordings([tmp_path / "bags" / "loose" / "0.db3"])] == ["0.db3"]


def test_a_folder_of_bags_and_other_recordings_is_no_bag(tmp_path):
    for name in ("one.bag", "single.db3", "parts/0.db3", "parts/1.db3", "parts/notes.txt"):
        path = tmp_path / "bags" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    assert [r.name for r in find_recordings([tmp_path / "bags"])] == ["one.bag", "parts", "single.db3"]


def test_two_ways_to_one_recording_are_one(folder):
    assert len(find_recordings([folder / "b.mcap", folder / "b.mcap"])) == 1


def test_two_recordings_of_one_name_are_refused(folder):
    (folder / "deep" / "b.mcap").write_text("another")
    with pytest.raises(ConfigError, match="called b"):
        find_recordings([folder / "b.mcap", folder / "deep" / "b.mcap"])


def test_folders_that_lead_in_a_circle_are_entered_once_and_told(folder, caplog):
    (folder / "deep" / "up").symlink_to(folder)
    (folder / "deep" / "itself").symlink_to("itself")
    assert [r.name for r in find_recordings([folder])] == ["b", "bag", "deep/a", "desk"]
    assert "deep/up" in caplog.text
    assert "deep/itself" in caplog.text


def test_what_is_no_recording_is_refused(folder, tmp_path):
    for path in (tmp_path / "nothing", folder / "notes.txt"):
        with pytest.raises(SourceError, match=path.name):
            find_recordings([path])


def test_shards_part_the_recordings_without_rest():
    recordings = tuple(Recording(str(i), Path(str(i))) for i in range(11))
    parts = [shard_of(recordings, f"{i}/4") for i in range(4)]
    assert sorted(int(r.name) for part in parts for r in part) == list(range(11))
    assert {len(part) for part in parts} == {2, 3}
    assert shard_of(recordings, None) == recordings


@pytest.mark.parametrize("shard", ["4/4", "1", "a/4", "-1/4", "0/0", "1/2/3"])
def test_what_is_no_shard_is_refused(shard):
    with pytest.raises(ConfigError, match="i/n"):
        shard_of((), shard)


def test_the_key_follows_from_content_settings_and_arguments_but_not_from_names(folder, tmp_path):
    recordings = find_recordings([folder])
    keys = [job.key for job in plan(recordings, tmp_path)]
    assert len(set(keys)) == 4
    (folder / "b.mcap").rename(folder / "c.mcap")
    moved = plan(find_recordings([folder]), tmp_path)
    assert {job.name: job.key for job in moved}["c"] == keys[0]
    assert keys[0] != plan(recordings[1:], tmp_path, {"max_features": 300})[0].key
    assert plan(recordings[1:], tmp_path, {"max_features": 300})[0].key != keys[1]
    assert plan(recordings[1:], tmp_path, {}, [("end", 2.0)])[0].key != keys[1]


def test_a_file_among_the_arguments_counts_by_its_content(folder, tmp_path):
    recordings, camera = find_recordings([folder / "b.mcap"]), tmp_path / "camera.yaml"
    camera.write_text("one")
    one = plan(recordings, tmp_path, {}, [("camera", camera)])[0]
    camera.write_text("another")
    other = plan(recordings, tmp_path, {}, [("camera", camera)])[0]
    assert one.key != other.key
    assert one.arguments == other.arguments == (f"--camera={camera}",)


def test_a_change_of_program_makes_everything_due(folder, tmp_path, monkeypatch):
    recordings = find_recordings([folder])
    before = {job.key for job in plan(recordings, tmp_path)}
    monkeypatch.setattr("odom.batch.job.program_hash", lambda: "another")
    assert before.isdisjoint(job.key for job in plan(recordings, tmp_path))


def test_a_hash_is_computed_anew_when_the_file_has_changed(folder, tmp_path):
    file, hashes = folder / "b.mcap", ContentHashes(tmp_path)
    before = hashes.of(file)
    hashes.save()
    kept = json.loads((tmp_path / "hashes.json").read_text())
    kept[str(file)][1] = "remembered"
    (tmp_path / "hashes.json").write_text(json.dumps(kept))
    assert ContentHashes(tmp_path).of(file) == "remembered"
    file.write_text("c.mcap")
    os.utime(file, ns=(1, 1))
    assert ContentHashes(tmp_path).of(file) not in (before, "remembered")


def test_hashing_ends_on_request_and_keeps_what_it_knows(folder, tmp_path):
    read, is_stopped = [], []
    hashes = ContentHashes(tmp_path, read.append, lambda: bool(is_stopped))
    hashes.of(folder / "b.mcap")
    is_stopped.append(True)
    (folder / "large.mcap").write_bytes(bytes(3_000_000))
    with pytest.raises(OdomError, match="the next call goes on"):
        hashes.of(folder / "large.mcap")
    assert max(read) < 3
    hashes.save()
    assert list(json.loads((tmp_path / "hashes.json").read_text())) == [str(folder / "b.mcap")]


def test_a_killed_batch_keeps_the_hashes_of_all_but_its_last_seconds(folder, tmp_path, monkeypatch):
    monkeypatch.setattr("odom.batch.content_hashes._SAVE_PERIOD_S", 0.0)
    ContentHashes(tmp_path).of(folder / "b.mcap")
    assert (tmp_path / "hashes.json").exists()


def test_hashes_that_cannot_be_remembered_end_no_batch(folder, tmp_path, caplog):
    (tmp_path / "hashes.json").mkdir()
    hashes = ContentHashes(tmp_path)
    assert len(hashes.of(folder / "b.mcap")) == 32
    hashes.save()
    assert "hashes.json cannot be written" in caplog.text


def test_a_folder_counts_by_names_and_bytes_of_its_files(folder, tmp_path):
    hashes = [ContentHashes(tmp_path).of(folder / "desk")]
    (folder / "desk" / "rgb" / "1.png").write_text("other bytes")
    hashes.append(ContentHashes(tmp_path).of(folder / "desk"))
    (folder / "desk" / "rgb" / "1.png").rename(folder / "desk" / "rgb" / "2.png")
    hashes.append(ContentHashes(tmp_path).of(folder / "desk"))
    assert len(set(hashes)) == 3


def test_images_that_lie_elsewhere_count(folder, tmp_path):
    for name in ("linked", "listed", "inside"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "2.png").write_text("bytes")
    desk = folder / "desk"
    (desk / "depth").symlink_to(tmp_path / "linked")
    (desk / "rgb" / "more").symlink_to(tmp_path / "inside")
    (desk / "rgb" / "up").symlink_to(desk)
    (desk / "rgb.txt").write_text("1.0 rgb/1.png\n2.0 ../../listed/2.png\n")
    hashes = {ContentHashes(tmp_path).of(desk)}
    for name in ("linked", "listed", "inside"):
        (tmp_path / name / "2.png").write_text("other bytes")
        hashes.add(ContentHashes(tmp_path).of(desk))
    assert len(hashes) == 4


def test_a_folder_whose_lists_cannot_be_read_is_hashed(folder, tmp_path):
    (folder / "desk" / "rgb.txt").write_text("nonsense in the first line\nand in the second\n")
    assert len(ContentHashes(tmp_path).of(folder / "desk")) == 32


def test_names_that_are_no_utf8_are_hashed(folder, tmp_path):
    (folder / "desk" / "rgb" / os.fsdecode(b"caf\xe9.png")).touch()
    assert len(ContentHashes(tmp_path).of(folder / "desk")) == 32


@pytest.mark.parametrize("spoilt", ["", "[]", "{", '{"x": 3}', '{"x": []}'])
def test_spoilt_memories_of_hashes_are_forgotten(folder, tmp_path, spoilt):
    (tmp_path / "hashes.json").write_text(spoilt.replace("x", str(folder / "b.mcap")))
    assert len(ContentHashes(tmp_path).of(folder / "b.mcap")) == 32


def test_a_worker_of_another_version_does_no_job(folder, tmp_path):
    from dataclasses import replace

    from odom.batch.worker import run_job

    job: Job = replace(plan(find_recordings([folder / "b.mcap"]), tmp_path)[0], program="older")
    with pytest.raises(ConfigError, match="another version"):
        run_job(job)
