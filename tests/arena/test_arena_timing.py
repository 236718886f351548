"""The faults of time: a rolling shutter of the colour camera, a latency of the depth stream."""

from dataclasses import dataclass

import numpy as np
import pytest

from odom.geometry import se3
from sensors.arena import ArenaOptions, frame
from sensors.arena import frames as session
from sensors.arena.camera_path import Infinity, make_walk
from sensors.arena.frames import DEPTH_LATENCY_S
from sensors.arena.row_readout import READOUT_S

TURNING = (0.0, 0.0, 0.0, 0.0, 1.0, 0.0)
CARRIED_ALONG = (0.5, 0.0, 0.3, 0.1, -0.6, 0.3)


@dataclass(frozen=True)
class Steady:
    """Through a place of the laboratory with one velocity (m/s and rad/s, of the camera)."""

    twist: tuple[float, ...]

    def T_world_camera(self, t: float) -> np.ndarray:
        return Infinity().T_world_camera(3.3) @ se3.exp(t * np.array(self.twist))


def drawn(options: ArenaOptions, walk: Steady, t: float) -> np.ndarray:
    """The picture without noise whose middle row is of `t`, grey."""
    scene = session._scene("laboratory", options.seed, 0, False)
    return session.unpack(session._light(options, scene, walk, t)).mean(axis=2)


@pytest.mark.parametrize("twist", [TURNING, CARRIED_ALONG], ids=["turning", "carried along"])
@pytest.mark.parametrize(
    "camera",
    [{}, {"distortion": True}, {"half": True}, {"sensor": "kinect2"}],
    ids=["kinect1", "bent lens", "half size", "kinect2"],
)
def test_each_row_shows_what_a_perfect_camera_sees_at_the_rows_instant(monkeypatch, camera, twist) -> None:
    monkeypatch.setattr(session, "EXPOSURE_S", 0.0)
    faulty, perfect, walk = ArenaOptions(**camera), ArenaOptions(faults=False, **camera), Steady(twist)
    rolled, still = drawn(faulty, walk, 0.0), drawn(perfect, walk, 0.0)
    height = faulty.camera.height
    rows = [*range(0, height // 4, 15), *range(3 * height // 4, height, 15), height - 1]
    shifts, off_rolled, off_still = [], 0.0, 0.0
    for row in rows:
        expected = drawn(perfect, walk, (row / height - 0.5) * READOUT_S)[row]
        slope = np.gradient(expected)
        shifts.append(slope @ (rolled[row] - expected) / (slope @ slope))
        off_rolled += np.abs(rolled[row] - expected).mean()
        off_still += np.abs(still[row] - expected).mean()
    assert np.abs(shifts).max() < 0.3
    assert off_rolled < 0.25 * off_still


def test_the_truth_is_the_pose_at_the_stamp(faulty: ArenaOptions) -> None:
    shot = frame(faulty, 200)
    at_stamp = make_walk(faulty).T_world_camera((shot.stamp - faulty.start) * 1e-9)
    assert np.allclose(shot.T_world_camera, at_stamp, atol=1e-6)


def test_a_perfect_camera_shows_the_instant_of_its_stamp(monkeypatch, ideal: ArenaOptions) -> None:
    shot, walk = frame(ideal, 200), make_walk(ideal)
    scene = session._scene("laboratory", ideal.seed, 0, False)
    assert np.array_equal(shot.rgb, session.unpack(session._light(ideal, scene, walk, 200 / 30.0)))


@pytest.mark.parametrize("sensor", ["kinect1", "kinect2"])
def test_depth_shows_the_scene_some_milliseconds_before_its_stamp(sensor: str) -> None:
    faulty, perfect = ArenaOptions(sensor=sensor), ArenaOptions(sensor=sensor, faults=False)
    walk = Steady(TURNING)
    measured = session._depth(faulty, walk, 0, 0.0, False).astype(float)

    def off(t: float) -> float:
        """How many pixels are on another surface than a perfect camera sees at `t`."""
        expected = session._depth(perfect, walk, 0, t, False)
        known = (measured > 0) & (expected > 0)
        return float((np.abs(measured - expected)[known] > 0.1 * expected[known]).mean())

    at = np.linspace(-2.0, 1.0, 13) * DEPTH_LATENCY_S
    assert abs(at[np.argmin([off(float(t)) for t in at])] + DEPTH_LATENCY_S) < 0.3 * DEPTH_LATENCY_S
    assert off(-DEPTH_LATENCY_S) < 0.5 * off(0.0)
