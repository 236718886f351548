"""Things that stood in the scene and are carried away, and people who stop for a while: the pose does not jump."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from painted_room import SMALL, START, PaintedRoom, stroll

from odom import Odometry, OdometrySettings
from odom.backend import Estimate, State
from odom.evaluation.painter import Painter
from odom.evaluation.passers_by import PasserBy, passers_by
from odom.frontend.camera.lens import Lens
from odom.geometry import se3
from odom.geometry.arrays import Array

ROOM = PaintedRoom()
RATE_HZ = 15


@dataclass(frozen=True, eq=False)
class Leaver(PasserBy):
    """A body that comes at `comes_s`, stands where it is, and leaves to the side at `leaves_s`."""

    comes_s: float = -np.inf
    leaves_s: float = np.inf

    def T_anchor_body(self, t: float) -> Array:
        T = np.eye(4)
        away_m = self.speed_m_s * (max(0.0, t - self.leaves_s) - max(0.0, self.comes_s - t))
        T[:3, 3] = 0.15 + away_m, 0.0, self.distance_m
        return T


@dataclass(frozen=True, eq=False)
class Pushed(Leaver):
    """A body that stands where it is until `leaves_s`, and is then pushed to the side, quicker and quicker."""

    acceleration_m_s2: float = 0.5

    def T_anchor_body(self, t: float) -> Array:
        T, since_s = np.eye(4), max(0.0, t - self.leaves_s)
        until_s = min(since_s, self.speed_m_s / self.acceleration_m_s2)
        T[0, 3] = 0.15 + 0.5 * self.acceleration_m_s2 * until_s**2 + self.speed_m_s * (since_s - until_s)
        T[2, 3] = self.distance_m
        return T


def walk(body: Leaver, seconds: float, settings: OdometrySettings | None = None, rate_hz: int = RATE_HZ):
    """Run the odometry before a body; yield time, odometry, estimate and T_map_camera of each frame."""
    T_room_anchor = stroll(0.0)

    def T_camera_anchor(stamp: int) -> Array:
        return se3.inverse(stroll((stamp - START) * 1e-9)) @ T_room_anchor

    painter = Painter(SMALL, (body,), START, T_camera_anchor, Lens.of(SMALL))
    odometry = Odometry(SMALL, settings)
    for number in range(int(seconds * rate_hz)):
        t = number / rate_hz
        frame, _ = painter.paint(ROOM.frame(SMALL, 30 // rate_hz * number, stroll(t)))
        yield t, odometry, odometry.process(frame), se3.inverse(T_room_anchor) @ stroll(t)


def body(**times: float) -> Leaver:
    (one,) = passers_by(SMALL, 1.0, share=0.3, speed_m_s=0.8)
    values = {name: getattr(one, name) for name in one.__dataclass_fields__}
    return replace(Leaver(**values), **times)


def landmarks_in_the_place_of(leaver: Leaver, odometry: Odometry, T_map_camera: Array) -> int:
    """How many landmarks lie where the body stood, and in view."""
    L = odometry.map.landmarks
    position = L.position[L.alive]
    x, y, z = position.T
    half_m, depth_m = leaver.width_m / 2.0, leaver.distance_m
    is_there = (abs(x - 0.15) < half_m) & (abs(y) < leaver.height_m / 2.0) & (abs(z - depth_m) < 0.15)
    seen = se3.apply(se3.inverse(T_map_camera), position)
    off_axis = abs(seen[:, :2] / seen[:, 2:]) * SMALL.fx
    return int((is_there & (off_axis < [SMALL.width / 2 - 12, SMALL.height / 2 - 12]).all(axis=1)).sum())


def off_m(estimate: Estimate, T_map_camera: Array) -> float:
    assert estimate.T_odom_camera is not None
    return float(np.linalg.norm((se3.inverse(estimate.T_odom_camera) @ T_map_camera)[:3, 3]))


@pytest.mark.rendered
@pytest.mark.parametrize("looked_for", [400, 100])
def test_a_box_that_is_carried_away_leaves_the_map_within_a_second_and_the_pose_where_it_was(looked_for: int) -> None:
    settings = OdometrySettings(max_features=looked_for)
    box, before, after, offs_m = body(leaves_s=2.0), 0, [], [0.0]
    gone_s = box.leaves_s + box.width_m / box.speed_m_s
    for t, odometry, estimate, T_map_camera in walk(box, gone_s + 1.4, settings):
        offs_m.append(off_m(estimate, T_map_camera))
        if t < box.leaves_s:
            before = landmarks_in_the_place_of(box, odometry, T_map_camera)
        elif t > gone_s + 1.0:
            after.append(landmarks_in_the_place_of(box, odometry, T_map_camera))
    assert max(offs_m) < 0.02
    assert np.abs(np.diff(offs_m)).max() < 0.01
    assert before >= 10
    assert max(after) <= 0.05 * before


@pytest.mark.rendered
def test_a_box_that_is_pushed_off_does_not_take_the_camera_along() -> None:
    (one,) = passers_by(SMALL, 1.0, share=0.3, speed_m_s=0.6)
    values = {name: getattr(one, name) for name in one.__dataclass_fields__}
    box = Pushed(**values, leaves_s=1.5)
    seen = [(e.state, np.inf if e.T_odom_camera is None else off_m(e, T)) for _, _, e, T in walk(box, 3.0, rate_hz=30)]
    tracked_m = [off for state, off in seen if state is State.TRACKING]
    assert max(tracked_m) < 0.04
    assert len(tracked_m) > 0.7 * len(seen)
    assert all(state is not State.LOST for state, _ in seen)


@pytest.mark.rendered
@pytest.mark.slow
def test_a_person_who_stops_for_five_seconds_and_leaves_costs_no_jump_and_no_landmark_of_the_room() -> None:
    offs_m, alive = [], {}
    for t, odometry, estimate, T_map_camera in walk(body(comes_s=1.5, leaves_s=7.5), 9.5):
        offs_m.append(off_m(estimate, T_map_camera))
        L = odometry.map.landmarks
        alive[t] = set(L.identity[L.alive].tolist())
    assert max(offs_m) < 0.02
    assert np.abs(np.diff(offs_m)).max() < 0.01
    known = next(found for t, found in alive.items() if t > 1.0)
    assert len(known & alive[max(alive)]) > 0.7 * len(known)
