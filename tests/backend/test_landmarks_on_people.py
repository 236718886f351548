"""A person in the arena stands and then walks away: landmarks that were made on them leave the map within a second."""

import numpy as np
import pytest

from odom import Odometry, RgbdFrame
from odom.backend import Estimate
from odom.frontend.camera.lens import Lens
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask
from sensors.arena import ArenaOptions, moving_mask, render_walk
from sensors.arena.walkers import walker

OLD_S, GONE_S, END_S = 2.0, 1.0, 8.0
NEAR_M = 0.1


def on_mask(positions: Array, estimate: Estimate, frame: RgbdFrame, mask: Mask, lens: Lens) -> Mask:
    """Which of the positions (n x 3, m, map frame) lie in view on the surface of what the mask marks in a frame."""
    assert estimate.T_odom_camera is not None
    T_camera_map = se3.inverse(estimate.T_map_odom @ estimate.T_odom_camera)
    seen = lens.project(positions, T_camera_map)
    out = seen[:, 2] > 0.0
    u, v = seen[out, :2].astype(int).T
    depth_m = se3.apply(T_camera_map, positions[out])[:, 2]
    out[out] = mask[v, u] & (np.abs(frame.depth_mm[v, u] * 1e-3 - depth_m) < NEAR_M)
    return np.asarray(out)


@pytest.mark.slow
def test_landmarks_on_a_person_who_stood_are_gone_a_second_after_they_are_ten_centimetres_away() -> None:
    options = ArenaOptions(people=1)
    person = walker(0, 1.75)
    times = np.arange(0.0, END_S, 0.05)
    ways_m = (np.hypot(*np.subtract(person.posture(t)[:2], person.posture(0.0)[:2])) for t in times)
    begins_s = next(t for t, way_m in zip(times, ways_m, strict=False) if way_m > NEAR_M)
    odometry, lens, born = Odometry(options.camera), Lens.of(options.camera), {}
    standing, walking = [], []
    for index, rendered in enumerate(render_walk(options)):
        frame = rendered.rgbd()
        estimate, t = odometry.process(frame), index / 30.0
        landmarks = odometry.map.landmarks
        alive = np.flatnonzero(landmarks.alive)
        identities = landmarks.identity[alive].tolist()
        is_old = np.array([t - born.setdefault(one, t) > OLD_S for one in identities])
        if t > END_S:
            break
        if index % 5 == 0 and is_old.any():
            old = landmarks.position[alive][is_old]
            on_person = int(on_mask(old, estimate, frame, moving_mask(options, index), lens).sum())
            (standing if t < begins_s else walking if t > begins_s + GONE_S else []).append(on_person)
    print(f"away after {begins_s:.2f} s; landmarks before {standing}, a second after {walking}")
    assert min(standing) >= 10
    assert max(walking) <= 2
