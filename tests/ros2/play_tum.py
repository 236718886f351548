"""Plays a TUM folder as a camera of ROS 2 would publish it (bgr8, 32FC1, calibration), at its own speed.

Arguments: folder, port of the router, domain, `raw` or `compressed`, and speed (1: the recording's own).
"""

import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from ros2_network import other_node

from odom.frame import Stamp
from odom.wire import Message, Topics
from odom.wire.codec import cdr, decode_color, decode_depth, encode_depth_compressed, restamp
from odom.wire.ros2 import Ros2Node
from odom.wire.ros2.names import NodeName
from sensors.source import SourceOptions
from sensors.tum import open_tum

FRAME = "camera_color_optical_frame"
COLOR, DEPTH = "camera/rgb/image_raw", "camera/depth_registered/image_raw"


def raw(topic: str, stamp: Stamp, encoding: str, pixels: NDArray[np.generic]) -> Message:
    data = np.ascontiguousarray(pixels)
    height, width = data.shape[:2]
    return cdr.encode(
        topic, cdr.IMAGE, stamp, FRAME, height=height, width=width, encoding=encoding, is_bigendian=0,
        step=data.strides[0], data=data.reshape(-1).view(np.uint8),
    )  # fmt: skip


def driver_messages(folder: Path, compressed: bool, start: float = 0.0, end: float | None = None) -> Iterator[Message]:
    """Yield what a driver would publish of the folder, in the order of the stamps."""
    keys = Topics()
    for message in open_tum(folder, SourceOptions(topics=keys, start=start, end=end)).messages():
        at = message.stamp
        if message.topic == keys.camera_info:
            info = replace(message, topic="camera/rgb/camera_info")
        elif message.topic == keys.color_compressed:
            yield restamp(info, at)
            if compressed:  # the folder's own files: compressing them once more would make other images of them
                yield replace(message, topic=f"{COLOR}/compressed")
            else:
                yield raw(COLOR, at, "bgr8", cv2.cvtColor(decode_color(message), cv2.COLOR_RGB2BGR))
        elif message.topic == keys.depth:
            depth_mm = decode_depth(message)
            if compressed:
                yield encode_depth_compressed(f"{DEPTH}/compressedDepth", at, depth_mm, FRAME, "png")
            else:
                yield raw(DEPTH, at, "32FC1", np.where(depth_mm, depth_mm, np.nan).astype(np.float32) / 1000)


def on_time(messages: Iterable[Message], rate: float = 1.0) -> Iterator[Message]:
    """Yield messages at their stamps' pace."""
    begun: tuple[float, int] | None = None
    for message in messages:
        begun = begun or (time.monotonic(), message.stamp)
        time.sleep(max(0.0, begun[0] + (message.stamp - begun[1]) / 1e9 / rate - time.monotonic()))
        yield message


def main(folder: str, port: str, domain: str, form: str, rate: str) -> None:
    with other_node(int(port)) as session:
        node = Ros2Node(session.zenoh, NodeName(int(domain), str(session.zenoh.info.zid()), 0, "/", "camera"))
        for message in on_time(driver_messages(Path(folder), form == "compressed"), float(rate)):
            node.tell(message)
        node.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
