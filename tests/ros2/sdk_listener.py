"""A ROS 2 subscriber of `zenoh-ros2-sdk`, in a process of its own; prints one JSON object for each message.

Arguments: port of the router, domain, and `topic type` pairs; a `+` before a topic asks for what was kept.
"""

import json
import sys
import threading
import time
from functools import partial
from typing import Any

from zenoh_ros2_sdk import ROS2Subscriber
from zenoh_ros2_sdk.qos import QosDurability, QosProfile

from odom.wire.codec import schema
from odom.wire.ros2.names import type_hash

TOLD: list[str] = []


def told(topic: str, message: Any) -> None:
    fields: dict[str, Any] = {"topic": topic}
    first = message.transforms[0] if hasattr(message, "transforms") else message
    fields["frame"] = first.header.frame_id
    fields["stamp"] = first.header.stamp.sec * 1_000_000_000 + first.header.stamp.nanosec
    if hasattr(message, "poses"):
        fields["poses"] = len(message.poses)
    if hasattr(message, "child_frame_id"):
        position = message.pose.pose.position
        fields["position"] = [position.x, position.y, position.z]
        fields["covariance"] = message.pose.covariance.tolist()
    if hasattr(message, "data"):
        fields["bytes"] = len(message.data)
    sys.stdout.write(json.dumps(fields) + "\n")  # at once: several threads write
    sys.stdout.flush()
    TOLD.append(topic)


def main(port: str, domain: str, *topics: str) -> None:
    for topic, type_name in zip(topics[::2], topics[1::2], strict=True):
        kept = QosDurability.TRANSIENT_LOCAL if topic.startswith("+") else QosDurability.VOLATILE
        subscriber = ROS2Subscriber(
            topic.removeprefix("+"),
            type_name,
            partial(told, topic.removeprefix("+")),
            msg_definition=schema(type_name).decode(),
            node_name="listener",
            domain_id=int(domain),
            router_port=int(port),
            type_hash=type_hash(type_name),
            qos=QosProfile(durability=kept),
        )
        for _ in range(20 if topic.startswith("+") else 0):
            time.sleep(0.5)  # it has asked already, but straight after its own declarations Zenoh knows of no publisher
            subscriber._query_historical_data()
            if TOLD:
                break
    threading.Event().wait()


main(*sys.argv[1:])
