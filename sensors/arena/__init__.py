"""A simulated laboratory with a Kinect and an OptiTrack: `render_walk(ArenaOptions())` yields its frames."""

from sensors.arena.frames import ArenaFrame, frame, moving_mask, render_walk
from sensors.arena.options import ArenaOptions
from sensors.arena.source import open_arena

__all__ = ["ArenaFrame", "ArenaOptions", "frame", "moving_mask", "open_arena", "render_walk"]
