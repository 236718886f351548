"""A camera that wakes anywhere in the simulated laboratory: how soon it is found in a map, and how far off.

    python tests/map_file/kidnaps.py lab.map --visit 5 --starts 100

The map's first session must be a lap of the arena as it is made by default (`odom run arena --map lab.map`).
"""

import argparse
from collections import Counter
from pathlib import Path

import numpy as np

from odom.backend import Estimate, Odometry, State
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.map_file.map_file import MapFile
from sensors.arena import ArenaOptions
from sensors.arena.camera_path import make_walk
from sensors.arena.frames import frame

LAP = 961
"""Frames of a session."""


def map_of(path: Path, options: ArenaOptions) -> Path:
    """Walk a lap in the arena and leave its map."""
    opened = MapFile(path, is_written=True)
    odometry = Odometry(options.camera, None, opened.begin(options.camera))
    for number in range(LAP):
        odometry.process(frame(options, number).rgbd())
    odometry.finish()
    opened.put(odometry.take_map_changes())
    opened.close()
    return path


def first_pose(
    opened: MapFile, options: ArenaOptions, start: int, looks: int
) -> tuple[Estimate, Array, int] | tuple[None, None, int]:
    """Wake at frame `start`; return the first estimate with a pose, the true one and the frames before.

    None where there is none in `looks` frames.
    """
    odometry = Odometry(options.camera, None, opened.begin(options.camera))
    for before in range(looks):
        shown = frame(options, start + before)
        estimate = odometry.process(shown.rgbd())
        if estimate.state is not State.LOST:
            return estimate, true_pose(options, shown.stamp), before
    return None, None, looks


def true_pose(options: ArenaOptions, stamp: int) -> Array:
    """Return T_world_camera at a stamp."""
    return make_walk(options).T_world_camera((stamp - options.start) * 1e-9)


def T_world_map(opened: MapFile, options: ArenaOptions, session: int) -> Array:
    """Return where the map's coordinates are, by the first key frame of a session."""
    first = next(k for k in opened.keyframes() if k.session == session)
    return true_pose(options, first.stamp) @ se3.inverse(first.T_middle_stamp) @ first.T_camera_map


def away(estimate: Estimate, truth: Array, T_world_map: Array) -> tuple[float, float]:
    """Return how far off a pose is, in metres and degrees."""
    assert estimate.T_odom_camera is not None
    xi = se3.log(se3.inverse(truth) @ T_world_map @ estimate.T_map_odom @ estimate.T_odom_camera)
    return float(np.linalg.norm(xi[:3])), float(np.rad2deg(np.linalg.norm(xi[3:])))


def main() -> None:
    """Print how many are found after how many frames, and the worst errors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("map", type=Path)
    parser.add_argument("--visit", type=int, default=1)
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--looks", type=int, default=10)
    given = parser.parse_args()
    opened, options = MapFile(given.map, is_written=False), ArenaOptions(visit=given.visit)
    T, found = T_world_map(opened, ArenaOptions(), 0), Counter[str]()
    errors = [(0.0, 0.0)]
    for start in np.linspace(0, LAP - given.looks - 1, given.starts).astype(int).tolist():
        estimate, truth, before = first_pose(opened, options, start, given.looks)
        found[f"after {before} frames" if estimate is not None else "not at all"] += 1
        if estimate is not None and truth is not None:
            errors.append(away(estimate, truth, T))
    metres, degrees = np.max(errors, axis=0)
    print(dict(sorted(found.items())), f"at most {metres:.3f} m and {degrees:.2f} deg off")


if __name__ == "__main__":
    main()
