"""A map of fewer key frames: the camera is still found in it, nothing falls apart, and nothing else is changed."""

import shutil

import numpy as np
import pytest
from painted_room import SMALL, stroll
from typer.testing import CliRunner
from walks import HOUR, ROOM, away, rolled, shown, walk

from odom.backend import State
from odom.backend.map.memory import open_map
from odom.cli import app
from odom.errors import ConfigError, MapError
from odom.geometry import se3
from odom.map_file.map_file import MapFile


def pruned(path, out, keyframes):
    words = ["map", "prune", str(path), "-o", str(out), "--keyframes", str(keyframes)]
    return CliRunner().invoke(app, words, catch_exceptions=False)


def opened(path):
    return MapFile(path, is_written=False)


@pytest.fixture(scope="module")
def half(made, tmp_path_factory):
    path = tmp_path_factory.mktemp("pruned") / "half.map"
    count = len(made[1]) // 2
    assert f"{count} key frames" in pruned(made[0], path, count).output
    return path


def test_it_holds_as_many_as_were_asked_for_where_they_were(made, half):
    one, before = opened(half), opened(made[0])
    was = {k.stamp: k for k in before.keyframes()}
    keyframes = one.keyframes()
    assert len(keyframes) == len(made[1]) // 2
    assert keyframes[0].stamp == min(was)
    for k in keyframes:
        np.testing.assert_array_equal(k.T_camera_map, was[k.stamp].T_camera_map)
        assert one.fetch_place(k.number).descriptors.tobytes() == (
            before.fetch_place(was[k.stamp].number).descriptors.tobytes()
        )
    assert one.sessions() == before.sessions()
    assert CliRunner().invoke(app, ["map", "check", str(half)]).exit_code == 0


def test_every_key_frame_is_still_tied_to_every_other(half):
    one = opened(half)
    map_ = open_map(one.begin(SMALL))
    for k in map_.keyframes:
        assert map_.registrations.covariance_between(0, k.number) is not None
        assert map_.around(0, 1000) == set(range(len(map_.keyframes)))


def test_a_chain_through_what_is_gone_is_none_the_surer(made, half):
    one, before = opened(half), opened(made[0])
    few, all_ = open_map(one.begin(SMALL)), open_map(before.begin(SMALL))
    number = {k.stamp: k.number for k in all_.keyframes}
    for k in few.keyframes[1:]:
        now = few.registrations.covariance_between(0, k.number)
        then = all_.registrations.covariance_between(0, number[k.stamp])
        assert np.trace(now) > 0.999 * np.trace(then)


def test_landmarks_that_others_have_measured_stay(made, half):
    one, before = opened(half), opened(made[0])
    details = [one.fetch(k.number) for k in one.keyframes()]
    own = np.concatenate([d.landmarks.identity for d in details])
    measured = np.unique(np.concatenate([d.identities for d in details]))
    was = np.concatenate([before.fetch(k.number).landmarks.identity for k in before.keyframes()])
    assert len(np.unique(own)) == len(own)
    assert set(own) <= set(was)
    assert len(own) > 0.9 * np.isin(was, measured).sum()


def test_the_camera_is_found_in_it(half):
    for start in (0.6, 2.2, 4.1):
        truth = [stroll(start + k / 30.0) for k in range(12)]
        estimates, _ = walk(half, shown(truth, ROOM, HOUR), localize=True)
        assert [e.state for e in estimates[:2]] == [State.RECOVERED, State.TRACKING]
        assert all(away(stroll(0.0) @ e.T_odom_camera, T)[0] < 0.006 for e, T in zip(estimates, truth, strict=True))


def test_a_session_goes_on_in_it(half, tmp_path):
    path = shutil.copy(half, tmp_path / "half.map")
    away_from_it = [rolled(stroll(4.0 + k / 30.0), k) for k in range(45)]
    truth = [T @ se3.exp(np.array([0.0, 0.0, 0.0, 0.0, 0.02 * k, 0.0])) for k, T in enumerate(away_from_it)]
    estimates, odometry = walk(path, shown(truth, ROOM, HOUR))
    assert estimates[0].state is State.RECOVERED
    assert len(odometry.map.keyframes) > odometry.map.earlier_keyframes > 0
    assert all(away(stroll(0.0) @ e.T_odom_camera, T)[0] < 0.01 for e, T in zip(estimates, truth, strict=True))


def test_the_same_map_gives_the_same_bytes(made, half, tmp_path):
    pruned(made[0], tmp_path / "again.map", len(made[1]) // 2)
    assert (tmp_path / "again.map").read_bytes() == half.read_bytes()


def test_one_key_frame_is_left_at_least(made, tmp_path):
    assert "1 key frames" in pruned(made[0], tmp_path / "one.map", 1).output
    assert CliRunner().invoke(app, ["map", "check", str(tmp_path / "one.map")]).exit_code == 0


def test_what_cannot_be_pruned_is_refused(made, tmp_path):
    with pytest.raises(ConfigError, match="give fewer"):
        pruned(made[0], tmp_path / "out.map", len(made[1]))
    (tmp_path / "there.map").write_bytes(b"something")
    with pytest.raises(ConfigError, match="is there already"):
        pruned(made[0], tmp_path / "there.map", 1)
    content = bytearray(made[0].read_bytes())
    for at in range(len(content) // 3, len(content), 30_000):
        content[at] ^= 0xFF
    (tmp_path / "hurt.map").write_bytes(content)
    with pytest.raises(MapError, match="--mend"):
        pruned(tmp_path / "hurt.map", tmp_path / "out.map", 2)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["hurt.map", "there.map"]
