"""Frozen values that every part of the project shares: stamps, cameras and RGB-D frames."""

from odom.frame.camera import Camera as Camera
from odom.frame.depth_model import EXACT_DEPTH as EXACT_DEPTH
from odom.frame.depth_model import DepthModel as DepthModel
from odom.frame.depth_model import corrected_depth as corrected_depth
from odom.frame.rgbd import UNKNOWN_DEPTH_MM as UNKNOWN_DEPTH_MM
from odom.frame.rgbd import RgbdFrame as RgbdFrame
from odom.frame.stamp import Stamp as Stamp
from odom.frame.stamp import from_seconds as from_seconds
from odom.frame.stamp import seconds_text as seconds_text
from odom.frame.stamp import stamp_of as stamp_of
from odom.frame.stamp import to_seconds as to_seconds
