"""A camera of `zenoh-ros2-sdk`, in a process of its own: publishes colour, depth and calibration until it is killed.

Arguments: port of the router and domain.
"""

import sys
import time
from typing import Any

import numpy as np
from zenoh_ros2_sdk import ROS2Publisher

from odom.wire.codec import schema
from odom.wire.ros2.names import type_hash

WIDTH, HEIGHT = 64, 48


def main(port: str, domain: str) -> None:
    def publisher(topic: str, type_name: str) -> Any:
        return ROS2Publisher(
            topic,
            type_name,
            msg_definition=schema(type_name).decode(),
            node_name="sdk_camera",
            domain_id=int(domain),
            router_port=int(port),
            type_hash=type_hash(type_name),
        )

    color = publisher("/camera/color/image_raw", "sensor_msgs/msg/Image")
    depth = publisher("/camera/aligned_depth_to_color/image_raw", "sensor_msgs/msg/Image")
    info = publisher("/camera/color/camera_info", "sensor_msgs/msg/CameraInfo")
    types = color.session_mgr.store.types
    pixels = np.arange(WIDTH * HEIGHT * 3, dtype=np.uint32).astype(np.uint8)
    metres = np.full(WIDTH * HEIGHT, 1.5, dtype=np.float32).view(np.uint8)
    K = np.array([50.0, 0, 31.5, 0, 50, 23.5, 0, 0, 1])
    P = np.array([50.0, 0, 31.5, 0, 0, 50, 23.5, 0, 0, 0, 1, 0])
    roi = types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    while True:
        seconds, nanoseconds = divmod(time.time_ns(), 1_000_000_000)
        stamp = types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
        header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="camera_color_optical_frame")
        size: dict[str, Any] = {"header": header, "height": HEIGHT, "width": WIDTH}
        info.publish(
            **size, distortion_model="plumb_bob", d=np.zeros(5), k=K, r=np.eye(3).ravel(), p=P, binning_x=0,
            binning_y=0, roi=roi,
        )  # fmt: skip
        color.publish(**size, encoding="bgr8", is_bigendian=0, step=WIDTH * 3, data=pixels)
        depth.publish(**size, encoding="32FC1", is_bigendian=0, step=WIDTH * 4, data=metres)
        time.sleep(0.05)


main(*sys.argv[1:])
