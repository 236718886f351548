"""Minutes of frames through two real processes: nothing lost, cheap, and flat in memory (run with -m slow)."""

import multiprocessing as mp
import resource
import threading
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import psutil
import pytest

from odom.frame import Camera, Stamp
from odom.wire import Message, Topics, WireSettings
from odom.wire.assembler import FrameAssembler
from odom.wire.codec import encode_camera_info, encode_color, encode_depth
from odom.wire.consumer import Consumer
from odom.wire.image_counts import NO_COLOR
from odom.wire.session import open_session
from odom.wire.settings import ANY_LOCAL_PORT
from sensors.catalogue import open_source
from sensors.process import SensorProcess
from sensors.source import SourceOptions

TOPICS = Topics()
KEYS = (TOPICS.color, TOPICS.color_compressed, TOPICS.depth, TOPICS.camera_info)
PERIOD_NS = 33_333_333


class RawCamera:
    """A live VGA camera at 30 Hz whose images cost nothing to make."""

    lossless = False
    length = None

    def __init__(self, frames: int) -> None:
        rng = np.random.default_rng(1)
        self._color = [rng.integers(0, 256, (480, 640, 3), dtype=np.uint8) for _ in range(4)]
        self._depth = [rng.integers(0, 5000, (480, 640), dtype=np.uint16) for _ in range(4)]
        self._frames = frames

    def messages(self) -> Iterator[Message]:
        camera = Camera(640, 480, 525, 525, 319.5, 239.5)
        began = time.time_ns()
        yield encode_camera_info(TOPICS.camera_info, Stamp(began), camera)
        for i in range(self._frames):
            due = began + i * PERIOD_NS
            time.sleep(max(0.0, (due - time.time_ns()) / 1e9))
            yield encode_color(TOPICS.color, Stamp(due), self._color[i % 4])
            yield encode_depth(TOPICS.depth, Stamp(due + 10_000_000), self._depth[i % 4])

    def close(self) -> None:
        pass


def cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def run_camera(endpoint: str, frames: int, report: Connection) -> None:
    with open_session(WireSettings(connect=(endpoint,), listen=(ANY_LOCAL_PORT,))) as session:
        process = SensorProcess(session, RawCamera(frames), SourceOptions(), consumers=1)
        began = cpu_s()
        process.run(threading.Event())
        report.send(cpu_s() - began)


def run_recording(endpoint: str, folder: str) -> None:
    options = SourceOptions(loop=True)
    with open_session(WireSettings(connect=(endpoint,), listen=(ANY_LOCAL_PORT,))) as session:
        SensorProcess(session, open_source(folder, options), options, consumers=1).run(threading.Event())


@pytest.mark.slow
def test_a_live_raw_camera_for_a_minute_loses_nothing_and_costs_little() -> None:
    """The bar: no frame lost or unmatched, 6 ms of CPU a frame for encoding, sending, receiving and decoding."""
    frames, endpoint = 1800, "tcp/127.0.0.1:17451"
    receive, send = mp.Pipe(duplex=False)
    sensor = mp.get_context("spawn").Process(target=run_camera, args=(endpoint, frames, send))
    with open_session(WireSettings(connect=(), listen=(endpoint,))) as session:
        for message in RawCamera(2).messages():
            FrameAssembler(TOPICS).feed(message)  # the message definitions are compiled at their first use
        consumer, assembler, count = Consumer(session, TOPICS, "odometry", KEYS), FrameAssembler(TOPICS), 0
        sensor.start()
        delivery = consumer.receive(30.0)
        began = cpu_s()
        while delivery is not None:
            count += len(assembler.feed(delivery.message))
            delivery = consumer.receive(5.0)
        count += len(assembler.finish())
        cost_ms = 1e3 * (cpu_s() - began + receive.recv()) / frames
    sensor.join(10.0)
    total = consumer.total()
    print(f"{count} of {frames} frames, lost {total.lost}, dropped {total.dropped}, {cost_ms:.2f} ms CPU a frame")
    pairing = assembler.pairing
    assert (total.lost, total.dropped, pairing.color_single, pairing.depth.refused[NO_COLOR]) == (0, 0, 0, 0)
    assert count == frames
    assert cost_ms <= 6.0


@pytest.mark.slow
def test_memory_is_flat_over_ten_thousand_frames(shared_data: Path) -> None:
    endpoint, frames = "tcp/127.0.0.1:17452", 0
    folder = str(shared_data / "tum_fr1_rpy_part")
    sensor = mp.get_context("spawn").Process(target=run_recording, args=(endpoint, folder), daemon=True)
    rss_mb: list[float] = []
    with open_session(WireSettings(connect=(), listen=(endpoint,))) as session:
        consumer, assembler = Consumer(session, TOPICS, "odometry", KEYS), FrameAssembler(TOPICS, grey=True)
        sensor.start()
        processes = [psutil.Process(), psutil.Process(sensor.pid)]
        while frames < 10_000:
            delivery = consumer.receive(30.0)
            assert delivery is not None
            for frame in assembler.feed(delivery.message):
                frames += 1
                if frame.sequence % 500 == 499:
                    rss_mb.append(sum(process.memory_info().rss for process in processes) / 2**20)
        sensor.kill()
    print(f"resident MB every 500 frames: {[round(value) for value in rss_mb]}")
    assert rss_mb[-1] < 600
    assert rss_mb[-1] - rss_mb[3] < 15
    assert consumer.total().lost == 0
    assert assembler.pairing.color_single + assembler.pairing.depth.refused[NO_COLOR] < 0.01 * frames
