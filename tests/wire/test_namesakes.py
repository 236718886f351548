"""Two processes that do one job for one device are told of, with both names; a successor is not."""

import time
from collections.abc import Callable

import pytest
from private_network import OpenSession

from odom.wire import Topics, namesakes
from odom.wire.namesakes import Namesakes

TOPICS = Topics("cam0")


@pytest.fixture(autouse=True)
def as_if_on_several_hosts(monkeypatch: pytest.MonkeyPatch) -> None:
    hosts = iter(["rig", "desk", "spare", "laptop"])
    monkeypatch.setattr(namesakes.socket, "gethostname", lambda: next(hosts))
    monkeypatch.setattr(namesakes, "PATIENCE_S", 0.5)


def _wait_for(condition: Callable[[], bool], seconds: float = 10.0) -> bool:
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.02)
    return condition()


def test_two_sensors_of_one_device_are_told_to_both_and_to_the_odometry_once(open_peer: OpenSession) -> None:
    told: dict[str, list[str]] = {"odometry": [], "rig": [], "desk": []}
    watching = Namesakes(open_peer(), TOPICS, "sensor", told["odometry"].append, is_one=False)
    for name in ("rig", "desk"):
        Namesakes(open_peer(), TOPICS, "sensor", told[name].append)
    assert _wait_for(lambda: all(told.values()))
    time.sleep(1.0)
    for words in told.values():
        assert len(words) == 1
        assert "2 sensors" in words[0]
        assert "cam0" in words[0]
        assert "rig-" in words[0]
        assert "desk-" in words[0]
        assert "--namespace" in words[0]
    assert watching.conflict == told["odometry"][0]


def test_two_odometries_are_told_and_one_that_ends_ends_the_conflict(open_peer: OpenSession) -> None:
    told: list[str] = []
    first, second = open_peer(), open_peer()
    one = Namesakes(first, TOPICS, "odometry", told.append)
    Namesakes(second, TOPICS, "odometry", lambda words: None)
    assert _wait_for(lambda: bool(one.conflict))
    assert "2 odometry processes" in one.conflict
    second.close()
    assert _wait_for(lambda: not one.conflict)
    Namesakes(open_peer(), TOPICS, "odometry", lambda words: None)
    assert _wait_for(lambda: len(told) == 2)  # another one is told of again


def test_a_successor_and_other_devices_and_roles_are_no_conflict(open_peer: OpenSession) -> None:
    told: list[str] = []
    watcher, dying = open_peer(), open_peer()
    watching = Namesakes(watcher, TOPICS, "sensor", told.append, is_one=False)
    Namesakes(dying, TOPICS, "sensor", told.append)
    Namesakes(open_peer(), TOPICS, "sensor", told.append)  # is here before the other has gone
    Namesakes(watcher, Topics("cam1"), "sensor", told.append)
    Namesakes(watcher, TOPICS, "odometry", told.append)
    time.sleep(0.2)
    dying.close()
    time.sleep(1.0)
    assert told == []
    assert watching.conflict == ""
