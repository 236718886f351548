"""A map outlives its session: the camera is found in it from any attitude, and another session goes on in it."""

import numpy as np
import pytest
from painted_room import SMALL, PaintedRoom, stroll
from walks import HOUR, ROOM, away, facing, rolled, shown, walk

from odom.backend import Odometry, OdometrySettings, State
from odom.backend.map.memory import details_of
from odom.backend.tracking import confirmation
from odom.geometry import se3
from odom.map_file.map_file import MapFile


def test_what_was_saved_comes_back(made):
    path, poses = made
    opened = MapFile(path, is_written=False)
    saved = opened.begin(SMALL)
    opened.close()
    assert len(saved.keyframes) == len(poses) > 3
    for keyframe, T in zip(saved.keyframes, poses, strict=True):
        np.testing.assert_array_equal(keyframe.T_camera_map, T)
    assert {(e.a, e.b) for e in saved.edges} >= {(n, n + 1) for n in range(len(poses) - 1)}


def test_details_come_back_to_the_rounding_of_their_covariances(tmp_path):
    path = tmp_path / "room.map"
    _, odometry = walk(path, shown([stroll(k / 30.0) for k in range(60)], ROOM))
    opened = MapFile(path, is_written=False)
    for number in range(len(odometry.map.keyframes)):
        expected, found = details_of(odometry.map, number), opened.fetch(number)
        assert found is not None
        np.testing.assert_array_equal(found.identities, expected.identities)
        np.testing.assert_array_equal(found.measurements.values, expected.measurements.values)
        np.testing.assert_array_equal(found.landmarks.patch_full, expected.landmarks.patch_full)
        np.testing.assert_allclose(found.landmarks.position, expected.landmarks.position, atol=1e-12)
        np.testing.assert_allclose(found.landmarks.covariance, expected.landmarks.covariance, rtol=1e-5, atol=1e-12)
        place = opened.fetch_place(number)
        assert (place is None) == (expected.place is None)
        assert place is None or (place.descriptors == expected.place.descriptors).all()
    opened.close()


@pytest.mark.parametrize("roll", [0.0, 90.0, 180.0])
def test_a_camera_is_found_at_once_however_it_is_rolled(made, roll):
    path, _ = made
    before = path.read_bytes()
    truth = [rolled(stroll(1.0 + k / 30.0), roll) for k in range(12)]
    estimates, _ = walk(path, shown(truth, ROOM, HOUR), localize=True)
    assert [e.state for e in estimates[:2]] == [State.RECOVERED, State.TRACKING]
    for estimate, T in zip(estimates, truth, strict=True):
        metres, radians = away(stroll(0.0) @ estimate.T_map_odom @ estimate.T_odom_camera, T)
        assert metres < 0.005
        assert radians < 0.005
        sigma_m = np.sqrt(np.linalg.eigvalsh(estimate.covariance[:3, :3])[-1])
        assert 1e-4 < sigma_m < 0.01
    assert path.read_bytes() == before
    assert sorted(path.parent.iterdir()) == [path]


def test_in_a_place_that_is_not_in_the_map_there_is_no_pose_until_there_is(made):
    other = shown([stroll(k / 30.0) for k in range(45)], PaintedRoom(7), HOUR)
    known = shown([stroll(k / 30.0) for k in range(5)], ROOM, HOUR + 45)
    estimates, odometry = walk(made[0], [*other, *known], localize=True)
    assert {e.state for e in estimates[:45]} == {State.LOST}
    assert estimates[45].state is State.RECOVERED
    assert len(odometry.map.keyframes) - odometry.map.earlier_keyframes <= 1


@pytest.mark.long
def test_a_session_goes_on_where_the_one_before_ended(room_map):
    away_from_it = [rolled(facing(0.012 * k, 4.0 + k / 30.0), 30.0) for k in range(90)]
    estimates, odometry = walk(room_map, shown(away_from_it, ROOM, HOUR))
    assert estimates[0].state is State.RECOVERED
    assert {e.segment for e in estimates} == {0}
    assert len(odometry.map.keyframes) > odometry.map.earlier_keyframes > 0
    opened = MapFile(room_map, is_written=False)
    saved = opened.begin(SMALL)
    assert len(opened.sessions()) == 2
    assert {k.session for k in saved.keyframes} == {0, 1}
    opened.close()
    late = [rolled(stroll(6.0 + k / 30.0), 120.0) for k in range(5)]
    found, _ = walk(room_map, shown(late, ROOM, 2 * HOUR), localize=True)
    assert all(away(stroll(0.0) @ e.T_odom_camera, T)[0] < 0.01 for e, T in zip(found, late, strict=True))


@pytest.mark.long
def test_a_session_that_begins_elsewhere_is_joined_when_a_place_is_recognised(room_map):
    truth = [facing(max(2.6 - 0.03 * k, 0.0), k / 30.0) for k in range(120)]
    estimates, odometry = walk(room_map, shown(truth, ROOM, HOUR))
    assert estimates[0].state is State.TRACKING
    assert estimates[0].segment == 1
    assert estimates[-1].segment == 0
    assert any(loop.accepted for e in estimates for loop in e.loops)
    assert {k.segment for k in odometry.map.keyframes} == {0}
    last = estimates[-1]
    assert away(stroll(0.0) @ last.T_map_odom @ last.T_odom_camera, truth[-1])[0] < 0.03


@pytest.mark.long
def test_memory_holds_the_near_key_frames_and_the_file_all(tmp_path):
    settings = OdometrySettings(map_keyframes=10, local_keyframes=4, window_keyframes=4)
    path = tmp_path / "room.map"
    nods = (se3.exp(np.array([0.0, 0.0, 0.0, 0.5 * np.sin(k / 10.0), 0.0, 0.0])) for k in range(160))
    truth = [facing(0.025 * k, k / 30.0) @ T for k, T in enumerate(nods)]  # not so far that it sees its beginning again
    estimates, odometry = walk(path, shown(truth, ROOM), settings=settings)
    assert {e.state for e in estimates} == {State.TRACKING}
    assert len(odometry.map.remembered) <= 13 < len(odometry.map.keyframes)
    assert not odometry.map.forgotten
    opened = MapFile(path, is_written=False)
    assert all(opened.fetch(n) is not None for n in range(len(odometry.map.keyframes)))
    opened.close()
    back = [facing(0.25, 0.1 + k / 30.0) for k in range(10)]
    found, _ = walk(path, shown(back, ROOM, HOUR), localize=True)
    assert all(away(truth[0] @ e.T_odom_camera, T)[0] < 0.02 for e, T in zip(found, back, strict=True))


def test_without_a_map_nothing_is_kept():
    odometry = Odometry(SMALL)
    for frame in shown([stroll(k / 30.0) for k in range(5)], ROOM):
        odometry.process(frame)
    assert odometry.take_map_changes().is_empty


def test_a_doubtful_recognition_waits_for_a_second_frame(made, monkeypatch):
    truth = [stroll(1.0 + k / 30.0) for k in range(4)]
    monkeypatch.setattr(confirmation, "_is_sure", lambda tracked: False)
    estimates, _ = walk(made[0], shown(truth, ROOM, HOUR), localize=True)
    assert [e.state for e in estimates[:3]] == [State.LOST, State.RECOVERED, State.TRACKING]
    jump = [truth[0], rolled(stroll(0.0), 90.0), truth[2]]
    estimates, _ = walk(made[0], shown(jump, ROOM, HOUR), localize=True)
    assert {e.state for e in estimates} == {State.LOST}


def test_a_closed_map_is_not_taken_for_a_damaged_one(made, caplog):
    opened = MapFile(made[0], is_written=False)
    opened.begin(SMALL)
    opened.close()
    opened.expect([0, 1])
    assert opened.fetch(0) is None
    assert opened.fetch_place(1) is None
    assert opened.lost == 0
    assert "left out" not in caplog.text
