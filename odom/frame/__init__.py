"""Frozen values that every part of the project shares: stamps, cameras and RGB-D frames."""

from odom.frame.camera import Camera
from odom.frame.depth_model import EXACT_DEPTH, DepthModel, corrected_depth
from odom.frame.rgbd import UNKNOWN_DEPTH_MM, RgbdFrame
from odom.frame.stamp import Stamp, from_seconds, seconds_text, stamp_of, to_seconds

__all__ = [
    "EXACT_DEPTH",
    "UNKNOWN_DEPTH_MM",
    "Camera",
    "DepthModel",
    "RgbdFrame",
    "Stamp",
    "corrected_depth",
    "from_seconds",
    "seconds_text",
    "stamp_of",
    "to_seconds",
]
