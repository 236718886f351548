"""Makes a process ready before the first frame: one thread for each library, everything compiled and loaded."""

import gc
import logging
import multiprocessing
import os
import signal
import socket
import threading
from collections.abc import Callable
from multiprocessing.synchronize import Event

import cv2
import numpy as np

from odom.backend import Odometry, OdometrySettings
from odom.backend.map import shape_covariance
from odom.backend.map.pose_graph import Edge, EdgeArrays, optimise
from odom.backend.mapping import bundle_adjustment, depth_filter
from odom.backend.tracking import consensus
from odom.calibration import warm_up as calibration
from odom.frame import Camera, RgbdFrame, Stamp
from odom.frontend.matching import moving_surfaces, surface_alignment
from odom.geometry.compiled import compiled_before, note_all_compiled
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
"""New objects before a compiler's interpreter collects garbage. Fewer: it does so in vain more often; without any
collection it takes 770 MB instead of 500."""
_POLL_S = 0.1
"""Time between two checks whether compilers are done or the request to stop has come."""


def warm_up(settings: OdometrySettings, topics: Topics, stop: threading.Event | None = None) -> threading.Event:
    """Run made-up frames through codec and odometry, and a small pose graph; exclude it all from garbage collection.

    Otherwise the first frames would wait for imports and compilation, as would the first relocalisation and the first
    closed loop. The very first start does not wait for the code that calibrates a run after some seconds: the returned
    event is set once that is compiled and loaded, too. It is never set, and nobody waits for it, after `stop` was set
    while something was being compiled; then nothing may be ready.
    """
    stop = stop or threading.Event()
    keep_little()
    gc.freeze()  # what has been imported stays: collecting it would take a tenth of a second
    cv2.setNumThreads(1)
    calibration_ready = ReadyUnlessStopped(stop)
    patience = threading.Timer(_PATIENCE_S, _LOG.info, ["compiling: the first start takes up to half a minute longer"])
    patience.daemon = True
    patience.start()
    compilers = None if compiled_before() else _Compilers(settings, topics)
    if compilers is not None and not compilers.have_done_all_but_calibration(stop):
        patience.cancel()
        return calibration_ready
    _warm_up_frames(settings, topics)
    _warm_up_background()
    if compilers is None:
        _warm_up_calibration(settings.self_calibration)
        calibration_ready.set()
    patience.cancel()
    gc.collect()
    gc.freeze()
    give_back_freed()
    give_back_code()
    if compilers is not None:
        arguments = (compilers, settings.self_calibration, calibration_ready, stop)
        threading.Thread(target=_load_calibration_code, args=arguments, name="calibration-code", daemon=True).start()
    return calibration_ready


class ReadyUnlessStopped(threading.Event):
    """An event for which nobody waits any longer once `stop` is set."""

    def __init__(self, stop: threading.Event) -> None:
        super().__init__()
        self._stop = stop

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until it is set, or `stop` is: then return False. A `timeout` is that of one look."""
        while not super().wait(_POLL_S if timeout is None else timeout):
            if self._stop.is_set() or timeout is not None:
                return False
        return True


class _Compilers:
    """Two processes that compile at the first start; what they compile is shared on disk.

    A compiler works in one thread, and would not notice a request to stop for half a minute: so the process that was
    asked to stop compiles nothing itself, and ends these two. They also end when it is gone.
    """

    def __init__(self, settings: OdometrySettings, topics: Topics) -> None:
        context = multiprocessing.get_context("spawn")
        self._all_but_calibration = context.Event()
        self._frames = context.Process(target=_compile_frames, args=(settings, topics), daemon=True)
        self._rest = context.Process(target=_compile_rest, args=(self._all_but_calibration,), daemon=True)
        self._frames.start()
        self._rest.start()

    def have_done_all_but_calibration(self, stop: threading.Event) -> bool:
        """Wait until all but the calibration is compiled; False when `stop` was set before."""
        return self._finish(
            stop, lambda: self._frames.is_alive() or (self._rest.is_alive() and not self._all_but_calibration.is_set())
        )

    def have_done_all(self, stop: threading.Event) -> bool:
        """Wait until all is compiled; False when `stop` was set before."""
        return self._finish(stop, self._rest.is_alive)

    def _finish(self, stop: threading.Event, are_busy: Callable[[], bool]) -> bool:
        """Wait until they are no longer busy; where `stop` is set before, end both and return False."""
        while are_busy():
            if stop.wait(_POLL_S):
                for process in (self._frames, self._rest):
                    process.terminate()
                    process.join()
                return False
        return True


def _become_compiler() -> None:
    """Leave Ctrl-C to the process that started this one, and end with that."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.set_threshold(_COMPILERS_YOUNG_OBJECTS)

    def end_with_parent() -> None:
        if (parent := multiprocessing.parent_process()) is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=end_with_parent, name="parent-watch", daemon=True).start()


def _compile_frames(settings: OdometrySettings, topics: Topics) -> None:
    _become_compiler()
    _warm_up_frames(settings, topics)


def _compile_rest(all_but_calibration: Event) -> None:
    _become_compiler()
    _warm_up_background()
    all_but_calibration.set()
    calibration.warm_up()


def _warm_up_frames(settings: OdometrySettings, topics: Topics) -> None:
    """Track made-up frames, the camera being lost in between, and make all messages of them."""
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


def _warm_up_background() -> None:
    """Register made-up pairs, adjust a bundle and a pose graph, choose between poses, and so on, once.

    It begins with what frames need soonest.
    """
    registration.warm_up()
    bundle_adjustment.warm_up()
    consensus.warm_up()
    depth_filter.warm_up()
    small = np.zeros((48, 64), dtype=np.uint16)
    codec.decode_depth(codec.encode_depth_compressed("depth", Stamp(0), small, codec="rvl"))
    moving_surfaces.warm_up()
    surface_alignment.warm_up()
    still = np.tile(np.eye(4), (2, 1, 1))
    optimise(still, np.array([True, False]), EdgeArrays.of([Edge(0, 1, np.eye(4), np.eye(6), True)]))
    shape_covariance.warm_up()
    nearest(np.zeros((1, 3)), np.zeros((1, 3)), 1)


def _warm_up_calibration(self_calibration: bool) -> None:
    if self_calibration:
        calibration.warm_up()


def _load_calibration_code(
    compilers: _Compilers, self_calibration: bool, is_loaded: threading.Event, stop: threading.Event
) -> None:
    if not compilers.have_done_all(stop):
        return
    try:
        _warm_up_calibration(self_calibration)
        give_back_code()
        note_all_compiled()
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
