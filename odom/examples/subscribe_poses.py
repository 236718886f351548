"""Print the poses that an odometry publishes, by Zenoh and ROS 2's messages alone. Arguments: [ENDPOINT].

The endpoint is the one that `odom run` prints first, or a router's; tcp/127.0.0.1:7447 is that of `odom serve`.
"""

import json
import sys
from typing import Any

import zenoh
from rosbags.typesys import Stores, get_typestore

ros = get_typestore(Stores.ROS2_HUMBLE)
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps(sys.argv[1:] or ["tcp/127.0.0.1:7447"]))

with zenoh.open(config) as session, session.declare_subscriber("cam0/*") as subscriber:
    print("listening", flush=True)
    for sample in subscriber:
        key, payload = str(sample.key_expr), sample.payload.to_bytes()
        if key == "cam0/odom":
            pose: Any = ros.deserialize_cdr(payload, "nav_msgs/msg/Odometry")
            t, covariance = pose.pose.pose.position, pose.pose.covariance.reshape(6, 6)
            seconds = pose.header.stamp.sec + 1e-9 * pose.header.stamp.nanosec
            print(f"{seconds:.3f} s: {t.x:.4f} {t.y:.4f} {t.z:.4f} m, variance of x {covariance[0, 0]:.2e} m^2")
        elif key == "cam0/end":
            break
