"""Frames that never move against those of the contract, in the axes that ROS expects of bodies and worlds (REP-103).

The contract's frames have the axes of an image: x right, y down, z forward. RViz and robots want x forward, y left,
z up.
"""

import numpy as np

from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.wire.codec import encode_tf
from odom.wire.message import Message
from odom.wire.topics import Topics

TF_STATIC = "tf_static"
"""Key of transforms that do not change (tf2_msgs/TFMessage)."""

T_LINK_OPTICAL: Array = np.array(
    [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""From x right, y down, z forward to x forward, y left, z up."""


def static_frames(topics: Topics, stamp: Stamp) -> Message:
    """Return the message that joins to a device's tree `cam0_link`, its body, and `map_upright`, the map's parent."""
    link = topics.frame_camera.replace("color_optical_frame", "link")
    upright = (f"{topics.frame_map}_upright", topics.frame_map, T_LINK_OPTICAL)
    body = (topics.frame_camera, link, T_LINK_OPTICAL.T)
    return encode_tf(stamp, (upright, body), topic=TF_STATIC)
