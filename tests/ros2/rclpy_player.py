"""A node of rclpy, without anything of this project; publishes messages that come on standard input.

Argument: domain. Each message is a line `topic type bytes` and then so many bytes of CDR. It is read into a message of
its type, so that what is published was written by ROS. With 0 bytes the topic is only offered. It says `ready` on
standard output when it is, and after a line `wait` it says `heard` when somebody listens to every topic.
"""

import importlib
import sys
import time

import rclpy
from rclpy.serialization import deserialize_message


def main(domain):
    rclpy.init(domain_id=int(domain))
    node = rclpy.create_node("camera")
    publishers = {}
    print("ready", flush=True)
    for line in iter(sys.stdin.buffer.readline, b""):
        if line == b"wait\n":
            while not all(publisher.get_subscription_count() for publisher in publishers.values()):
                time.sleep(0.05)
            print("heard", flush=True)
            continue
        topic, type_name, size = line.decode().split()
        package, _, name = type_name.partition("/msg/")
        kind = getattr(importlib.import_module(f"{package}.msg"), name)
        if topic not in publishers:
            publishers[topic] = node.create_publisher(kind, topic, 10)
        if int(size):
            publishers[topic].publish(deserialize_message(sys.stdin.buffer.read(int(size)), kind))
    node.destroy_node()
    rclpy.shutdown()


main(*sys.argv[1:])
