"""The adapter against the real libOpenNI2, with a virtual driver below it."""

import queue
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import psutil
import pytest
from closing import closed_after
from virtual_kinect.device import Kinects, VirtualKinect, noise

from odom.errors import ConfigError, DeviceError, RecordingError
from odom.wire import Message, Topics
from odom.wire.codec import decode_camera_info, decode_color, decode_depth, decode_status
from sensors.calibration_file import Calibration, calibration_text
from sensors.default_camera import kinect_camera
from sensors.depth_registration import DepthRegistration, registration_text
from sensors.openni2 import library, open_kinect
from sensors.openni2.playback import OniRecording
from sensors.source import Source, SourceOptions

TOPICS = Topics("cam0")


def options(**extra: str) -> SourceOptions:
    return SourceOptions(topics=TOPICS, color="raw", extra=tuple(extra.items()))


def images(source: Source, topic: str, count: int) -> Iterator[Message]:
    return islice((message for message in source.messages() if message.topic == topic), count)


def split(messages: list[Message]) -> tuple[list[Message], list[Message]]:
    return [m for m in messages if m.topic == TOPICS.color], [m for m in messages if m.topic == TOPICS.depth]


def until(source: Source, seconds: float) -> list[Message]:
    end = time.monotonic() + seconds
    taken = []
    for message in source.messages():
        taken.append(message)
        if time.monotonic() > end:
            return taken
    return taken


def frame_numbers(played: list[np.ndarray], true: np.ndarray) -> list[int]:
    """Return which frame of the virtual device each image is; fails unless every pixel is the same."""
    by_first_row = {image[0].tobytes(): index for index, image in enumerate(true)}
    numbers = [by_first_row[image[0].tobytes()] for image in played]
    for image, number in zip(played, numbers, strict=True):
        assert np.array_equal(image, true[number])
    return numbers


def test_every_pixel_arrives_unmirrored_in_order_at_30_hz_and_what_is_lost_is_counted(kinects: Kinects) -> None:
    kinect = kinects(frames=90)
    source = open_kinect("kinect", options())
    try:
        messages = until(source, 2.5)
    finally:
        source.close()
    assert messages[0].topic == TOPICS.camera_info
    color, depth = split(messages)
    true_color, true_depth = noise(90)
    missing = 0
    for numbers in (
        frame_numbers([decode_color(m) for m in color], true_color),
        frame_numbers([decode_depth(m) for m in depth], true_depth),
    ):
        assert len(numbers) > 60
        assert numbers == sorted(set(numbers))
        missing += numbers[-1] - numbers[0] + 1 - len(numbers)
    assert missing <= source.counters["lost"] + source.counters["dropped"] <= missing + 2
    assert np.median(np.diff([m.stamp for m in color])) == pytest.approx(1e9 / 30, rel=0.02)
    assert kinect.set_by_application["color_mirror"] == kinect.set_by_application["depth_mirror"] == 0
    assert kinect.set_by_application["image_registration"] == 1


def test_who_reads_late_gets_what_the_camera_sees_from_then_on(kinects: Kinects) -> None:
    kinects(loop=1)
    source = open_kinect("kinect", options())
    time.sleep(1.0)  # as long as it takes until the consumers are there
    reading = time.time_ns()
    try:
        first = next(images(source, TOPICS.color, 1))
    finally:
        source.close()
    # What waited would come all at once, faster than anybody can take it: 0.4 s of images are held.
    assert first.stamp > reading - 200_000_000


def test_factory_intrinsics_come_from_the_field_of_view(kinects: Kinects) -> None:
    kinects(horizontal_fov=1.0, vertical_fov=0.8)
    source = open_kinect("kinect", options())
    try:
        camera = decode_camera_info(next(source.messages()))
    finally:
        source.close()
    assert camera.fx == pytest.approx(320 / np.tan(0.5))
    assert camera.fy == pytest.approx(240 / np.tan(0.4))
    assert (camera.cx, camera.cy) == (319.5, 239.5)


def test_small_images_at_60_hz_when_asked(kinects: Kinects) -> None:
    kinects(loop=1)
    source = open_kinect("kinect", options(size="320x240", fps="60"))
    try:
        color = list(images(source, TOPICS.color, 60))
    finally:
        source.close()
    assert decode_color(color[0]).shape == (240, 320, 3)
    assert np.median(np.diff([m.stamp for m in color])) == pytest.approx(1e9 / 60, rel=0.02)


def test_exposure_is_fixed_on_request(kinects: Kinects) -> None:
    kinect = kinects()
    open_kinect("kinect", options(auto_exposure="off")).close()
    assert kinect.set_by_application["color_auto_exposure"] == 0
    assert kinect.set_by_application["color_auto_white_balance"] == 0


def test_exposure_that_cannot_be_fixed_is_told(
    kinects: Kinects, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    kinects()
    api = library.load()
    asked = api.VideoStream.is_property_supported
    automatic = api.c_api.ONI_STREAM_PROPERTY_AUTO_EXPOSURE
    monkeypatch.setattr(
        api.VideoStream, "is_property_supported", lambda stream, name: name != automatic and asked(stream, name)
    )
    open_kinect("kinect", options()).close()
    assert "exposure" not in caplog.text
    open_kinect("kinect", options(auto_exposure="off")).close()
    assert "auto_exposure=off changes nothing" in caplog.text


def test_images_that_nobody_takes_yet_are_not_dropped(kinects: Kinects) -> None:
    kinects(loop=1)
    source = open_kinect("kinect", options())
    time.sleep(1.5)
    assert source.counters["dropped"] == 0
    stream = images(source, TOPICS.color, 1)
    assert next(stream)
    time.sleep(1.5)
    assert source.counters["dropped"] > 20
    source.close()


@pytest.mark.parametrize("wanted", ["virtual://b", "B2"])
def test_a_device_is_chosen_by_address_or_serial_number(kinects: Kinects, wanted: str) -> None:
    kinects("a", serial="A1")
    kinects("b", serial="B2")
    source = open_kinect(f"kinect:{wanted}", options())
    source.close()
    assert (source.capture.uri, source.capture.serial) == ("virtual://b", "B2")


@pytest.mark.parametrize(
    ("unit", "bits"), [(1.0, 64), (60.0, 32), (0.008, 32)], ids=["microseconds", "60 MHz, wrapping", "0.125 ms"]
)
def test_stamps_are_host_time_without_drift_or_jitter_in_any_unit(kinects: Kinects, unit: float, bits: int) -> None:
    # With 60 ticks a microsecond 32 bits wrap after 71 s: start just before.
    first = 70_600_000 if bits == 32 else 1_000_000
    kinects(loop=1, ticks_per_microsecond=unit, stamp_bits=bits, first_stamp_us=first, drift_ppm=80, jitter_us=8000)
    source = open_kinect("kinect", options())
    try:
        started = time.time_ns()
        color = [m.stamp for m in images(source, TOPICS.color, 120)]
        ended = time.time_ns()
    finally:
        source.close()
    assert started - 1e9 < color[0] < color[-1] < ended
    # Of 8 ms of jitter nothing is left between two frames, but where the estimate of the offset was bettered (how far
    # that may go is tested in test_clock, on times that no machine's load disturbs). Lost frames leave whole periods.
    intervals = np.diff(np.array(color[40:], dtype=np.int64)) / (1e9 / 30)
    assert np.median(np.abs(intervals - np.round(intervals))) < 0.005


def test_colour_and_depth_keep_their_offset(kinects: Kinects) -> None:
    kinects(loop=1, depth_offset_us=11_000, jitter_us=3000)
    source = open_kinect("kinect", options())
    try:
        color, depth = split(list(islice(source.messages(), 150)))
    finally:
        source.close()
    stamps = np.array([c.stamp for c in color[30:]])
    offset = [d.stamp - stamps[np.abs(stamps + 11_000_000 - d.stamp).argmin()] for d in depth[30:]]
    assert np.median(offset) == pytest.approx(11e6, abs=1e6)


def test_images_news_of_the_device_and_the_end_come_though_the_hosts_clock_is_set_back(
    kinects: Kinects, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinects(loop=1)
    source = open_kinect("kinect", replace(options(), seconds=2.5))
    opened, hour, true_ns = time.monotonic(), 3600 * 10**9, time.time_ns
    back = time.time_ns() + 1_500_000_000
    monkeypatch.setattr(time, "time_ns", lambda: true_ns() - (hour if true_ns() > back else 0))
    try:
        messages = list(islice(source.messages(), 400))
    finally:
        source.close()
    assert time.monotonic() - opened < 5
    after = [m for m in messages if m.stamp < back - hour // 2]
    color, depth = split(after)
    assert min(len(color), len(depth)) > 20
    assert any(m.topic == TOPICS.device for m in after)


def test_unplugged_and_replugged_ten_times_it_resumes_and_leaks_nothing(
    kinects: Kinects, caplog: pytest.LogCaptureFixture
) -> None:
    kinect = kinects(loop=1)
    source = open_kinect("kinect", options())
    stream = (m for m in source.messages() if m.topic == TOPICS.color)
    process = psutil.Process()
    resumed, said, usage = [], [], []
    try:
        next(stream)
        for away_s in np.linspace(0.3, 2.1, 10):  # it may come back at any moment between two looks for it
            until_time = time.monotonic() + 0.3
            while time.monotonic() < until_time:
                last = next(stream).stamp
            kinect.unplug()
            unplugged = time.monotonic()
            while "is gone" not in caplog.text and time.monotonic() < unplugged + 5:
                time.sleep(0.005)
            said.append(time.monotonic() - unplugged)
            caplog.clear()
            time.sleep(away_s)
            kinect.plug()
            plugged = time.time_ns()
            stamp = next(m.stamp for m in stream if m.stamp > plugged)
            resumed.append((time.time_ns() - plugged) * 1e-9)
            assert stamp > last
            usage.append(
                (threading.active_count(), process.num_threads(), process.num_fds(), process.memory_info().rss)
            )
    finally:
        source.close()
    assert max(said) < 0.5
    assert max(resumed) < 2.0
    # The first cycles fill caches; from then on nothing grows.
    assert usage[-1][:3] == usage[3][:3]
    assert usage[-1][3] - usage[3][3] < 4e6
    assert source.counters["reconnects"] == 10


def test_seconds_end_a_take_though_the_device_is_gone(kinects: Kinects) -> None:
    kinect = kinects(loop=1)
    source = open_kinect("kinect", replace(options(), seconds=1.5))
    stream = source.messages()
    next(m for m in stream if m.topic == TOPICS.color)
    begun = time.monotonic()
    kinect.unplug()
    with closed_after(6.0, source):
        list(stream)
        assert 1.0 < time.monotonic() - begun < 3.0


def unplugged_for(kinect: VirtualKinect, seconds: float, source: Source) -> float:
    """Take the device away for so long; return how long after that the first new image came, or fail."""
    stamps: queue.Queue[int] = queue.Queue()

    def read() -> None:
        for message in source.messages():
            stamps.put(message.stamp)

    threading.Thread(target=read, daemon=True).start()
    stamps.get(timeout=5)
    kinect.unplug()
    time.sleep(seconds)
    kinect.plug()
    plugged = time.time_ns()
    while stamps.get(timeout=8) < plugged:
        pass
    return (time.time_ns() - plugged) * 1e-9


def test_a_device_that_returns_at_any_moment_is_found_by_a_driver_that_watches_the_bus(kinects: Kinects) -> None:
    # The library hangs when it is shut down while such a driver waits to tell it of a device. One that seldom looks
    # lets a device return just then: whatever is done one to two seconds after the loss coincides with its return.
    kinect = kinects(loop=1)
    kinects.watched_every(1000)
    source = open_kinect("kinect", options())
    try:
        assert unplugged_for(kinect, 2.5, source) < 1.5
    finally:
        source.close()
    assert source.counters["reconnects"] == 1


def test_a_device_that_is_forbidden_for_a_moment_after_its_return_is_opened_when_it_may_be(kinects: Kinects) -> None:
    # So it is with every USB camera: first it is there, then udev gives it to its group.
    kinect = kinects(loop=1)
    source = open_kinect("kinect", options())
    kinect.switch("forbidden")
    threading.Timer(2.0, kinect.switch, ("forbidden", False)).start()
    try:
        assert unplugged_for(kinect, 1.0, source) < 2.0
    finally:
        source.close()
    assert source.counters["reconnects"] == 1


def test_a_device_returns_under_a_driver_that_lists_devices_only_at_its_start(
    kinects: Kinects, caplog: pytest.LogCaptureFixture
) -> None:
    kinect = kinects(loop=1, hotplug=0, tells_serial=0)
    source = open_kinect("kinect", options(silence_s="0.5"))
    try:
        assert unplugged_for(kinect, 3.0, source) < 2.0
    finally:
        source.close()
    assert source.capture.serial == ""
    assert source.counters["reconnects"] == 1
    assert "delivers no" not in caplog.text  # both were silent: no stream is missing


def test_a_device_without_serial_number_is_not_replaced_by_another_that_was_there_all_along(kinects: Kinects) -> None:
    # In a process of its own: once one of two devices was lost, the library may crash when it is loaded again.
    kinect = kinects("a", loop=1, tells_serial=0)
    kinects("b", loop=1, tells_serial=0)
    script = """
import os, threading
from sensors.openni2 import open_kinect
from sensors.source import SourceOptions

source = open_kinect("kinect:virtual://a", SourceOptions())
threading.Timer(4.0, source.close).start()
for message in source.messages():
    pass
print(source.capture.uri, source.counters["reconnects"], flush=True)
os._exit(0)
"""
    sensor = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    opened_by = time.monotonic() + 20
    while not (kinect.folder / "settings.txt").exists() and time.monotonic() < opened_by:
        time.sleep(0.05)
    time.sleep(0.5)
    kinect.unplug()
    kinect.configure(uri="virtual://c")
    time.sleep(1.0)
    kinect.plug()
    assert sensor.communicate(timeout=20)[0].split() == ["virtual://c", "1"]


def test_an_oni_recording_is_played_bit_by_bit_and_ends(kinects: Kinects, tmp_path: Path) -> None:
    kinects(frames=60)
    file = record_oni(tmp_path / "take.oni", 1.0)
    source = open_kinect(f"kinect:{file}", options())
    assert source.lossless
    messages, again = list(source.messages()), list(source.messages())
    source.close()
    assert again == messages
    color, depth = split(messages)
    assert len(color) == source.length
    assert len(color) >= 10
    true_color, true_depth = noise(60)
    frame_numbers([decode_color(m) for m in color], true_color)
    frame_numbers([decode_depth(m) for m in depth], true_depth)
    intervals = np.diff([m.stamp for m in color]) / (1e9 / 30)
    assert intervals == pytest.approx(np.round(intervals), rel=1e-4)


def test_an_oni_file_is_opened_whatever_letters_its_name_has(kinects: Kinects, tmp_path: Path) -> None:
    # In a process of its own: the library crashes on such names.
    kinects(frames=60)
    file = record_oni(tmp_path / "take.oni", 0.5)
    (tmp_path / "Büro").mkdir()
    script = """
import sys
from sensors.openni2 import open_kinect
from sensors.source import SourceOptions

source = open_kinect(f"kinect:{sys.argv[1]}", SourceOptions())
for _ in range(10):
    assert sum(1 for _ in source.messages()) > 10
source.close()
"""
    played = subprocess.run(
        [sys.executable, "-c", script, file.rename(tmp_path / "Büro" / "Aufnahme ü.oni")],
        capture_output=True, text=True, check=False, timeout=60,
    )  # fmt: skip
    assert played.returncode == 0, played.stderr[-2000:]


def test_depth_of_an_oni_file_counts_as_registered_unless_the_calibration_says_how_it_is_not(
    kinects: Kinects, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    kinects(frames=60)
    file = record_oni(tmp_path / "take.oni", 0.5)
    camera = kinect_camera(640, 480)
    plain, two = tmp_path / "plain.yaml", tmp_path / "two.yaml"
    plain.write_text(calibration_text(Calibration(camera)))
    T_color_depth = np.eye(4)
    T_color_depth[0, 3] = 0.025
    two.write_text(plain.read_text() + registration_text(DepthRegistration(camera, camera, T_color_depth)))
    depth = []
    for calibration in (plain, two):
        source = open_kinect(f"kinect:{file}", replace(options(), camera=calibration))
        depth.append(decode_depth(next(images(source, TOPICS.depth, 1))))
        source.close()
    assert "NOT registered" not in caplog.text
    frame_numbers(depth[:1], noise(60)[1])
    assert not np.array_equal(*depth)
    with pytest.raises(ConfigError, match="registration=software"):
        open_kinect(f"kinect:{file}", replace(options(registration="software"), camera=plain))


def test_an_oni_file_can_be_played_and_closed_many_times(kinects: Kinects, tmp_path: Path) -> None:
    kinects(frames=60)
    file = record_oni(tmp_path / "take.oni", 0.5)
    script = """
import sys
from odom.wire import Topics
from sensors.openni2 import open_kinect
from sensors.source import SourceOptions

for _ in range(40):
    source = open_kinect(f"kinect:{sys.argv[1]}", SourceOptions(topics=Topics("cam0")))
    assert sum(1 for _ in source.messages()) > 10
    source.close()
"""
    played = subprocess.run(
        [sys.executable, "-c", script, file], capture_output=True, text=True, check=False, timeout=120
    )
    assert played.returncode == 0, played.stderr[-2000:]


def test_an_oni_file_is_not_closed_under_who_reads_it(
    kinects: Kinects, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinects(frames=60)
    source = open_kinect(f"kinect:{record_oni(tmp_path / 'take.oni', 1.0)}", options())
    assert isinstance(source, OniRecording)
    reading, closed_meanwhile = threading.Event(), threading.Event()
    wait = source._api.wait_for_any_stream

    def wait_slowly(streams: list[object], seconds: float) -> object:
        reading.set()
        time.sleep(0.3)
        if not streams[0]:
            closed_meanwhile.set()
            return None
        return wait(streams, seconds)

    monkeypatch.setattr(source._api, "wait_for_any_stream", wait_slowly)
    taken: list[Message] = []
    reader = threading.Thread(target=lambda: taken.extend(source.messages()), daemon=True)
    reader.start()
    assert reading.wait(5)
    source.close()
    reader.join(5)
    assert not reader.is_alive()
    assert not closed_meanwhile.is_set()
    assert list(source.messages()) == []
    source.close()


def record_oni(file: Path, seconds: float) -> Path:
    """Record in a process of its own: now and then the library's recorder deadlocks when it is destroyed."""
    program = Path(__file__).parent / "virtual_kinect" / "record_oni.py"
    for _ in range(3):
        try:
            subprocess.run([sys.executable, program, file, str(seconds)], check=True, timeout=seconds + 10)
            return file
        except subprocess.TimeoutExpired:
            continue
    pytest.fail("OpenNI2's recorder did not finish in three attempts")


def test_a_damaged_oni_file_is_refused(kinects: Kinects, tmp_path: Path) -> None:
    file = tmp_path / "broken.oni"
    file.write_bytes(b"not a recording" * 100)
    with pytest.raises(RecordingError, match=r"broken\.oni"):
        open_kinect(f"kinect:{file}", options())


def test_no_device_says_what_to_look_for(kinects: Kinects) -> None:
    with pytest.raises(DeviceError, match="lsusb"):
        open_kinect("kinect", options())


def test_a_wrong_serial_number_lists_what_there_is(kinects: Kinects) -> None:
    kinects("a", serial="A1")
    with pytest.raises(DeviceError, match="virtual://a"):
        open_kinect("kinect:Z9", options())


@pytest.mark.parametrize(("fault", "advice"), [("busy", "NiViewer"), ("forbidden", "udev")])
def test_a_device_that_will_not_open_is_explained(kinects: Kinects, fault: str, advice: str) -> None:
    kinects().switch(fault)
    with pytest.raises(DeviceError, match=advice):
        open_kinect("kinect", options())


def test_a_device_without_usb_bandwidth_is_explained(kinects: Kinects) -> None:
    kinects().switch("starved")
    source = open_kinect("kinect", options(start_s="0.5"))
    try:
        with pytest.raises(DeviceError, match="bandwidth"):
            next(source.messages())
    finally:
        source.close()


@pytest.mark.parametrize(("fault", "missing"), [("starved_depth", "depth"), ("starved_color", "colour")])
def test_a_stream_without_usb_bandwidth_is_named(kinects: Kinects, fault: str, missing: str) -> None:
    kinects(loop=1).switch(fault)
    source = open_kinect("kinect", options(start_s="0.7"))
    try:
        with pytest.raises(DeviceError, match=f"no {missing} .*bandwidth"):
            until(source, 5)
    finally:
        source.close()


@pytest.mark.parametrize(("fault", "missing"), [("starved_depth", "depth"), ("starved_color", "colour")])
def test_a_device_of_which_one_stream_falls_silent_says_so_and_is_opened_again(
    kinects: Kinects, caplog: pytest.LogCaptureFixture, fault: str, missing: str
) -> None:
    kinect = kinects(loop=1)
    source = open_kinect("kinect", options(silence_s="2.5"))
    topic = TOPICS.depth if missing == "depth" else TOPICS.color
    stream, opened, said = source.messages(), time.monotonic(), []
    try:
        next(m for m in stream if m.topic == topic)
        kinect.switch(fault)
        for message in stream:
            if message.topic == TOPICS.device:
                said += decode_status(message)
            if source.counters["reconnects"] or time.monotonic() > opened + 8:
                break
        kinect.switch(fault, on=False)
        resumed = time.time_ns()
        assert next(m.stamp for m in stream if m.topic == topic and m.stamp > resumed)
        news = next(m for m in stream if m.topic == TOPICS.device and m.stamp > resumed)
        assert [status.message for status in decode_status(news)] == ["delivering"]
    finally:
        source.close()
    assert (1, f"no {missing}") in [(status.level, status.message) for status in said]
    assert f"delivers no {missing}" in caplog.text
    assert source.counters["reconnects"] == 1


def test_a_device_that_falls_silent_is_opened_again(kinects: Kinects) -> None:
    kinect = kinects(loop=1)
    source = open_kinect("kinect", options(silence_s="0.5"))
    stream = (m for m in source.messages() if m.topic == TOPICS.color)
    try:
        next(stream)
        kinect.switch("starved")
        time.sleep(0.8)
        kinect.switch("starved", on=False)
        resumed = time.time_ns()
        assert next(m.stamp for m in stream if m.stamp > resumed)
    finally:
        source.close()
    assert source.counters["reconnects"] == 1


def test_an_image_size_it_does_not_have_lists_those_it_has(kinects: Kinects) -> None:
    kinects()
    with pytest.raises(DeviceError, match="640x480 at 30 Hz"):
        open_kinect("kinect", options(size="1280x1024"))


def test_an_unknown_option_is_named() -> None:
    with pytest.raises(ConfigError, match="colour_temperature"):
        open_kinect("kinect", options(colour_temperature="warm"))
