"""Getting a process ready: one thread a library, everything compiled and loaded before the first frame."""

import gc
import logging
import os
import socket
import threading

import cv2
import numpy as np

from odom.backend import Odometry, OdometrySettings
from odom.backend.graph import Edge, optimise
from odom.frame import Camera, RgbdFrame, Stamp
from odom.registration import default as registration
from odom.registration.compiled import release_compiler
from odom.service.keyframes import keyframe_message
from odom.service.publication import feature_message, map_messages, pose_messages
from odom.service.tally import Tally
from odom.wire import Topics, codec

_LOG = logging.getLogger(__name__)
_WARM_FRAMES = 10
_LOST_AT = 8
_PATIENCE_S = 4.0


def warm_up(settings: OdometrySettings, topics: Topics) -> None:
    """Run a made-up scene through codec and odometry, and a small graph; then spare the collector all of it.

    Without it the first frames would wait for imports and compilation, seconds on a machine's first run, and those at
    the first known place and the first closed loop for theirs; so the camera is lost in between.
    """
    cv2.setNumThreads(1)
    patience = threading.Timer(_PATIENCE_S, _LOG.info, ["compiling: the first start takes about half a minute longer"])
    patience.daemon = True
    patience.start()
    camera = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
    texture = np.random.default_rng(1).integers(0, 256, (60, 80), dtype=np.uint8)
    scene = np.asarray(cv2.resize(texture, (700, 500), interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
    codec.decode_camera_info(codec.encode_camera_info(topics.camera_info, Stamp(0), camera))
    odometry = Odometry(camera, settings)
    for i in range(_WARM_FRAMES):
        stamp = Stamp(i * 33_333_333 + (3_000_000_000 if i >= _LOST_AT else 0))
        image = np.ascontiguousarray(scene[i : i + 480, 3 * i : 3 * i + 640])
        rgb = np.repeat(image[..., None], 3, axis=2)
        depth = np.full((480, 640), 2000 + 3 * i, dtype=np.uint16)
        jpeg = codec.encode_color_jpeg(topics.color_compressed, stamp, rgb)
        raw = codec.encode_color(topics.color, stamp, rgb)
        codec.decode_color(raw, grey=True)
        decoded = codec.decode_depth(codec.encode_depth(topics.depth, stamp, depth))
        codec.decode_depth(codec.encode_depth_compressed(topics.depth_compressed, stamp, depth, codec="rvl"))
        frame = RgbdFrame(i, stamp, codec.decode_color(jpeg, grey=True), stamp, decoded)
        odometry.anticipate(stamp, frame.color)
        estimate = odometry.process(frame)
        list(pose_messages(topics, estimate))
        list(map_messages(topics, estimate))
        feature_message(topics, estimate)
        keyframe_message(topics, frame, camera, jpeg, 100)
    odometry.finish()
    registration.warm_up()
    codec.encode_status(topics.status, codec.Status(stamp, "", 0, "", Tally().status()))
    still = np.eye(4)
    optimise({0: still, 1: still}, 0, [Edge(0, 1, still, np.eye(6))])
    patience.cancel()
    del odometry
    release_compiler()
    gc.collect()
    gc.freeze()


def notify_service_manager(state: str) -> None:
    """Tell systemd `READY=1` or `STOPPING=1` when it asked to be told (`Type=notify`); does nothing elsewhere."""
    address = os.environ.get("NOTIFY_SOCKET")
    if not address:
        return
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notify:
            notify.connect("\0" + address[1:] if address.startswith("@") else address)
            notify.sendall(state.encode())
    except OSError as error:
        _LOG.warning("the service manager cannot be told %s: %s", state, error)
