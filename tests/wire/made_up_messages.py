"""Images and messages that the wire's tests share."""

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.frame import Camera, Stamp
from odom.wire import Message, Topics, truth
from odom.wire.codec import cdr, encode_camera_info, encode_color_jpeg, encode_depth, encode_pose
from odom.wire.codec import image_messages as images

PERIOD_NS = 33_333_333
BEGIN = 1_700_000_000_000_000_000


def textured(height: int = 48, width: int = 64, seed: int = 0) -> NDArray[np.uint8]:
    patches = np.random.default_rng(seed).integers(0, 256, (height // 8, width // 8, 3), dtype=np.uint8)
    return np.asarray(cv2.resize(patches, (width, height), interpolation=cv2.INTER_CUBIC), dtype=np.uint8)


def kinect_depth(height: int = 48, width: int = 64, seed: int = 0) -> NDArray[np.uint16]:
    """Smooth surfaces with holes, as a Kinect sees them."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[:height, :width]
    depth = 1500 + 3 * rows + 2 * columns + rng.integers(-5, 6, (height, width))
    depth[rng.random((height, width)) < 0.2] = 0
    return depth.astype(np.uint16)


def mono16(topic: str, stamp: Stamp, grey: NDArray[np.uint16], big: int = 0) -> Message:
    """An image message of 16 bits of grey (H x W), its upper byte first where `big` is 1."""
    pixels = grey.astype(">u2" if big else "<u2").view(np.uint8)
    return cdr.encode(
        topic, cdr.IMAGE, stamp, "camera", height=grey.shape[0], width=grey.shape[1], encoding="mono16",
        is_bigendian=big, step=pixels.strides[0], data=pixels.reshape(-1),
    )  # fmt: skip


def plain_png(topic: str, stamp: Stamp, image: NDArray[np.uint8] | NDArray[np.uint16]) -> Message:
    """A PNG file in a message whose format says nothing else."""
    bgr = image[..., ::-1] if image.ndim == 3 else image
    return images._encode_compressed(topic, stamp, "png", cv2.imencode(".png", bgr)[1].tobytes(), "camera")


def session_messages(frames: int, topics: Topics | None = None, height: int = 48, width: int = 64) -> list[Message]:
    """Calibration, then depth, colour and a truth pose of each frame, in the order of their stamps."""
    keys = topics or Topics()
    camera = Camera(width, height, 0.8 * width, 0.8 * width, width / 2, height / 2)
    messages = [encode_camera_info(keys.camera_info, Stamp(BEGIN), camera)]
    for i in range(frames):
        at = BEGIN + i * PERIOD_NS
        T = np.eye(4)
        T[:3, 3] = 0.01 * i, 0.05 * np.sin(i / 5), 0.05 * np.cos(i / 7)
        messages.append(encode_depth(keys.depth, Stamp(at), kinect_depth(height, width, i)))
        messages.append(encode_color_jpeg(keys.color_compressed, Stamp(at + 5_000_000), textured(height, width, i)))
        messages.append(encode_pose(truth("camera"), Stamp(at + 10_000_000), T, "mocap"))
    return messages
