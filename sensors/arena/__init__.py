"""A simulated laboratory with a Kinect and an OptiTrack: `render_walk(ArenaOptions())` yields its frames."""

from sensors.arena.generate import ArenaFrame, frame, render_walk
from sensors.arena.options import ArenaOptions

__all__ = ["ArenaFrame", "ArenaOptions", "frame", "render_walk"]
