"""A node of rclpy, without anything of this project; prints one JSON object for each message until it is killed.

Arguments: domain, and `topic type` pairs; a `+` before a topic asks for what was kept.
"""

import importlib
import json
import sys
import time
from functools import partial

import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile


def fields(value, depth=0):
    """Plain values of a message; long arrays by their length and sum."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: fields(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, (str, int, float, bool)):
        return value
    if isinstance(value, bytes):
        return list(value)
    values = list(value)
    if len(values) > 64 and not hasattr(values[0], "get_fields_and_field_types"):
        return {"length": len(values), "sum": int(sum(values))}
    return [fields(each) for each in values]


def told(topic, started, message):
    brief = {"topic": topic, "arrived": time.time_ns()}
    if started == "brief":
        brief["stamp"] = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
    else:
        brief["fields"] = fields(message)
    sys.stdout.write(json.dumps(brief) + "\n")
    sys.stdout.flush()


def main(domain, how, *topics):
    rclpy.init(domain_id=int(domain))
    node = rclpy.create_node("listener")
    for topic, type_name in zip(topics[::2], topics[1::2], strict=True):
        package, _, name = type_name.partition("/msg/")
        kept = topic.startswith("+")
        durability = DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE
        node.create_subscription(
            getattr(importlib.import_module(f"{package}.msg"), name),
            topic.removeprefix("+"),
            partial(told, topic.removeprefix("+"), how),
            QoSProfile(depth=10, durability=durability),
        )
    sys.stdout.write(json.dumps({"ready": True}) + "\n")
    sys.stdout.flush()
    rclpy.spin(node)


main(*sys.argv[1:])
