"""ROS 2 as rmw_zenoh speaks it: its names, keys, attachments and liveliness tokens, on Zenoh and without ROS."""

from odom.wire.ros2.node import Ros2Node as Ros2Node
from odom.wire.ros2.node import check_no_loop as check_no_loop
from odom.wire.ros2.node import join_ros2 as join_ros2
from odom.wire.ros2.static_frames import static_frames as static_frames
