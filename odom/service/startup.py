"""Makes a process ready before the first frame: one thread for each library, everything compiled and loaded."""

import gc
import logging
import multiprocessing
import os
import socket
import threading
from multiprocessing.synchronize import Event

import cv2
import numpy as np

from odom.backend import Odometry, OdometrySettings
from odom.backend.map.pose_graph import Edge, EdgeArrays, optimise
from odom.backend.mapping import bundle_adjustment
from odom.backend.tracking import consensus
from odom.calibration import warm_up as calibration
from odom.frame import Camera, RgbdFrame, Stamp
from odom.frontend.matching import moving_surfaces
from odom.geometry.compiled import compiled_before
from odom.geometry.neighbours import nearest
from odom.registration import gated_registration as registration
from odom.service.estimate_messages import (
    chain_message,
    feature_message,
    keyframe_message,
    landmark_message,
    pose_messages,
)
from odom.service.path_topics import PathTopics
from odom.service.run_statistics import RunStatistics
from odom.wire import Topics, codec
from odom.wire.allocator import give_back_code, give_back_freed, keep_little

_LOG = logging.getLogger(__name__)
_WARM_FRAMES = 10
"""Made-up frames: as few as reach every stage."""
_LOST_AT = 8
"""The frame before which 3 s are missing, so that the camera is lost and looks for a known place."""
_PATIENCE_S = 4.0
"""A start that takes longer is compiling, and is logged as such: loading compiled code takes less."""
_COMPILERS_YOUNG_OBJECTS = 50_000
"""New objects before the second compiler's interpreter collects garbage. Fewer: it does so in vain more often; without
any collection it takes 770 MB instead of 500."""
_COMPILER_POLL_S = 0.1
"""Time between two checks whether the second compiler has died; it reports itself when it is done."""


def warm_up(settings: OdometrySettings, topics: Topics) -> threading.Event:
    """Run made-up frames through codec and odometry, and a small pose graph; exclude it all from garbage collection.

    Otherwise the first frames would wait for imports and compilation, as would the first relocalisation and the first
    closed loop: so the made-up camera is lost in between. The very first start does not wait for the code that
    calibrates a run after some seconds: the returned event is set once that is compiled and loaded, too.
    """
    keep_little()
    gc.freeze()  # what has been imported stays: collecting it would take a tenth of a second
    cv2.setNumThreads(1)
    patience = threading.Timer(_PATIENCE_S, _LOG.info, ["compiling: the first start takes up to half a minute longer"])
    patience.daemon = True
    patience.start()
    compiler = None if compiled_before() else _SecondCompiler(settings.self_calibration)
    camera = Camera(480, 300, 394.0, 394.0, 239.5, 149.5)  # the smallest that is not enlarged
    texture = np.random.default_rng(1).integers(0, 256, (60, 96), dtype=np.uint8)
    scene = np.asarray(cv2.resize(texture, (528, 320), interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
    codec.decode_camera_info(codec.encode_camera_info(topics.camera_info, Stamp(0), camera))
    codec.decode_color(codec.encode_color(topics.color, Stamp(0), np.zeros((48, 64, 3), dtype=np.uint8)), grey=True)
    odometry, paths = Odometry(camera, settings), PathTopics(topics)
    for i in range(_WARM_FRAMES):
        stamp = Stamp(i * 33_333_333 + (3_000_000_000 if i >= _LOST_AT else 0))
        image = np.ascontiguousarray(scene[i : i + 300, 2 * i : 2 * i + 480])
        rgb = np.repeat(image[..., None], 3, axis=2)
        depth = np.full((300, 480), 2000 + 3 * i, dtype=np.uint16)
        jpeg = codec.encode_color_jpeg(topics.color_compressed, stamp, rgb)
        decoded = codec.decode_depth(codec.encode_depth(topics.depth, stamp, depth))
        frame = RgbdFrame(i, stamp, codec.decode_color(jpeg, grey=True), stamp, decoded)
        odometry.anticipate(stamp, frame.color)
        estimate = odometry.process(frame)
        list(pose_messages(topics, estimate))
        chain_message(topics, estimate)
        list(paths.messages(estimate))
        landmark_message(topics, estimate)
        feature_message(topics, estimate)
        keyframe_message(topics, frame, camera, jpeg, 100)
    odometry.finish()
    codec.encode_status(topics.status, codec.Status(stamp, "", 0, "", RunStatistics().status()))
    if compiler is not None:
        compiler.wait_for_all_but_calibration()
    _warm_up_background()
    del odometry
    calibration_ready = threading.Event()
    if compiler is None:
        _warm_up_calibration(settings.self_calibration)
        calibration_ready.set()
    patience.cancel()
    gc.collect()
    gc.freeze()
    give_back_freed()
    give_back_code()
    if compiler is not None:
        arguments = (compiler, settings.self_calibration, calibration_ready)
        threading.Thread(target=_load_calibration_code, args=arguments, name="calibration-code", daemon=True).start()
    return calibration_ready


class _SecondCompiler:
    """A process that compiles what frames do not need at once; both processes share the compiled code on disk.

    The compiler works in one thread. The process ends with this one.
    """

    def __init__(self, self_calibration: bool) -> None:
        context = multiprocessing.get_context("spawn")
        self._all_but_calibration = context.Event()
        arguments = (self_calibration, self._all_but_calibration)
        self._process = context.Process(target=_compile, args=arguments, daemon=True)
        self._process.start()

    def wait_for_all_but_calibration(self) -> None:
        """Wait until all but the calibration is compiled."""
        while self._process.is_alive() and not self._all_but_calibration.wait(_COMPILER_POLL_S):
            continue

    def wait(self) -> None:
        """Wait until all is compiled."""
        self._process.join()


def _compile(self_calibration: bool, all_but_calibration: Event) -> None:
    gc.set_threshold(_COMPILERS_YOUNG_OBJECTS)
    _warm_up_background()
    all_but_calibration.set()
    _warm_up_calibration(self_calibration)


def _warm_up_background() -> None:
    """Register made-up pairs, adjust a bundle, choose between poses, code depth, and adjust a small pose graph.

    The second compiler begins with what frames need soonest.
    """
    registration.warm_up()
    bundle_adjustment.warm_up()
    consensus.warm_up()
    small = np.zeros((48, 64), dtype=np.uint16)
    codec.decode_depth(codec.encode_depth_compressed("depth", Stamp(0), small, codec="rvl"))
    moving_surfaces.warm_up()
    still = np.tile(np.eye(4), (2, 1, 1))
    optimise(still, np.array([True, False]), EdgeArrays.of([Edge(0, 1, np.eye(4), np.eye(6), True)]))
    nearest(np.zeros((1, 3)), np.zeros((1, 3)), 1)


def _warm_up_calibration(self_calibration: bool) -> None:
    if self_calibration:
        calibration.warm_up()


def _load_calibration_code(compiler: _SecondCompiler, self_calibration: bool, is_loaded: threading.Event) -> None:
    try:
        compiler.wait()
        _warm_up_calibration(self_calibration)
        give_back_code()
    finally:
        is_loaded.set()


def notify_service_manager(state: str) -> None:
    """Send systemd `READY=1` or `STOPPING=1` if the unit asks for it (`Type=notify`)."""
    address = os.environ.get("NOTIFY_SOCKET")
    if not address:
        return
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notify:
            notify.connect("\0" + address[1:] if address.startswith("@") else address)
            notify.sendall(state.encode())
    except OSError as error:
        _LOG.warning("%s cannot be sent to the service manager: %s", state, error)
