"""Frozen values that every part of the project shares: stamps, cameras and RGB-D frames."""

from odom.frame.camera import Camera
from odom.frame.depth_model import DepthModel
from odom.frame.rgbd import RgbdFrame
from odom.frame.stamp import Stamp, from_seconds, to_seconds

__all__ = ["Camera", "DepthModel", "RgbdFrame", "Stamp", "from_seconds", "to_seconds"]
