"""How far a camera is off in the map of another day, against what is said of it: the map itself is bent."""

import numpy as np
import pytest
from kidnaps import LAP, map_of, true_pose

from odom.backend import Odometry, State
from odom.geometry import se3
from odom.map_file.map_file import MapFile
from sensors.arena import ArenaOptions
from sensors.arena.frames import frame

pytestmark = [pytest.mark.slow, pytest.mark.rendered, pytest.mark.timeout(3600)]


def mean_of(motions):
    """Return the motion that agrees best with all of them."""
    T = motions[0]
    for _ in range(5):
        T = T @ se3.exp(np.mean([se3.log(se3.inverse(T) @ one) for one in motions], axis=0))
    return T


@pytest.mark.parametrize("seed", [1, 2])
def test_another_visit_knows_how_sure_it_is(seed, tmp_path):
    path = map_of(tmp_path / "lab.map", ArenaOptions(seed=seed))
    opened, options = MapFile(path, is_written=False), ArenaOptions(seed=seed, visit=1)
    odometry = Odometry(options.camera, None, opened.begin(options.camera))
    made = ArenaOptions(seed=seed)
    T_world_map = mean_of(
        [true_pose(made, k.stamp) @ se3.inverse(k.T_middle_stamp) @ k.T_camera_map for k in opened.keyframes()]
    )
    errors, nees = [], []
    for number in range(LAP):
        shown = frame(options, number)
        estimate = odometry.process(shown.rgbd())
        assert estimate.state in (State.TRACKING, State.RECOVERED if number == 0 else State.TRACKING)
        T = T_world_map @ estimate.T_map_odom @ estimate.T_odom_camera
        error = se3.log(se3.inverse(T) @ true_pose(options, shown.stamp))
        errors.append(np.linalg.norm(error[:3]))
        nees.append(error @ np.linalg.solve(estimate.covariance, error))
    opened.close()
    print(f"RMS {1e3 * np.sqrt(np.mean(np.square(errors))):.2f} mm, NEES {np.mean(nees):.1f}")
    assert np.sqrt(np.mean(np.square(errors))) < 0.010
    assert np.mean(nees) <= 9.0
