"""How depth errs is written, sent and read as it was found, and corrected where a feature's depth is read."""

from dataclasses import replace

import numpy as np
import pytest

from odom.errors import ConfigError, WireError
from odom.frame import Camera, DepthModel, RgbdFrame, Stamp, corrected_depth
from odom.frontend.camera.lens import Lens
from odom.frontend.camera.noise_monitor import FeatureNoise, NoiseMonitor
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import StampClock
from odom.frontend.features.images import FrameImages
from odom.frontend.features.measurement import measure
from odom.frontend.features.view import View
from odom.wire import Topics
from odom.wire.assembler import FrameAssembler
from odom.wire.codec import cdr, decode_depth_model, encode_calibration, encode_camera_info
from sensors.calibration_file import Calibration, calibration_text, load_calibration

ERRING = DepthModel((1.5, -2.0), (-13.0, 0.5), (0.01, 0, 0, 0.002, 0, 0), (1.02, 0.01, 0, 0, 0, -0.005), (-0.1, 0.02))
CAMERA = Camera(640, 480, 520.0, 530.0, 310.0, 250.0, (0.1, -0.2, 0.001, 0.002, 0.05), ERRING)
KEYS = Topics().camera_info, Topics().depth_info


def test_a_file_is_read_as_it_was_written(tmp_path):
    file = tmp_path / "camera.yaml"
    file.write_text(calibration_text(Calibration(CAMERA, 1000.0), ["found: today"]))
    read = load_calibration(file)
    assert read == Calibration(CAMERA, 1000.0)
    assert file.read_text().startswith("# found: today\n")


@pytest.mark.parametrize(
    "wrong",
    ["{shift_px: [1]}", "{scale: [0, 0, 0, 0, 0, 0]}", "{offset: [.nan, 0, 0, 0, 0, 0]}", "{tilt: [1, 2]}", "7"],
)
def test_a_depth_model_that_cannot_be_used_is_refused_with_the_file_named(tmp_path, wrong):
    file = tmp_path / "camera.yaml"
    file.write_text(calibration_text(Calibration(replace(CAMERA, depth=DepthModel()))) + f"depth_model: {wrong}\n")
    with pytest.raises(ConfigError, match=r"camera\.yaml"):
        load_calibration(file)


def test_it_reaches_the_odometry_beside_the_calibration():
    assembler = FrameAssembler(Topics())
    for message in encode_calibration(KEYS, Stamp(5), CAMERA):
        assembler.feed(message)
    assert assembler.camera == CAMERA


def test_a_camera_without_it_sends_one_message_as_before():
    plain = replace(CAMERA, depth=DepthModel())
    assert encode_calibration(KEYS, Stamp(5), plain) == (encode_camera_info(KEYS[0], Stamp(5), plain),)


def test_a_recording_of_before_depth_could_be_stretched_is_read():
    message = encode_calibration(KEYS, Stamp(5), replace(CAMERA, depth=replace(ERRING, stretch=(0.0, 0.0))))[0]
    info = cdr.deserialise(message, cdr.CAMERA_INFO)
    info.d = info.d[:16]
    old = cdr.serialise(KEYS[1], cdr.CAMERA_INFO, Stamp(5), info)
    assert decode_depth_model(old) == replace(ERRING, stretch=(0.0, 0.0))


def test_another_calibration_of_a_depth_camera_says_nothing_and_broken_bytes_are_told():
    info = encode_camera_info(KEYS[1], Stamp(5), CAMERA)
    assert decode_depth_model(info) is None
    with pytest.raises(WireError):
        decode_depth_model(replace(info, payload=info.payload[:40]))


def sensor_of(camera):
    knots = np.array([0.2, 2.0])
    noise = NoiseMonitor.of(FeatureNoise(0.5, np.stack([knots, np.full(2, 0.002)])))
    model = SensorModel(Lens.of(camera), ShutterTiming(), np.eye(3), StampClock(), noise)
    return model.with_stamp(Stamp(0))


@pytest.mark.parametrize("seen_before", [True, False])
def test_depth_is_read_where_it_is_and_corrected(seen_before):
    """A slanted wall in a depth image that was taken from beside, with another focal length and in another unit."""
    camera = replace(CAMERA, distortion=())
    V, U = np.mgrid[0:480, 0:640].astype(float)
    slope = np.array([6e-4, -3e-4])
    true = 0.5 + slope[0] * (U - 320) + slope[1] * (V - 240)
    uv = np.random.default_rng(1).uniform((60, 60), (580, 420), (50, 2))
    wanted = 0.5 + (uv - (320, 240)) @ slope
    # what depth shows at a pixel is the wall at u, v of colour, of which the wall's own depth sets a part
    w = true
    for _ in range(20):
        u, v = (U + 1.5 - 13.0 * w + 31.95) / 1.1, (V - 2.0 + 0.5 * w - 4.79) / 0.98
        w = 0.5 + slope[0] * (u - 320) + slope[1] * (v - 240)
    x, y = (u - 319.5) / 320, (v - 239.5) / 320
    measured = 0.01 + 0.002 * x * x + w * (1.02 + 0.01 * x - 0.005 * y * y)
    depth = np.rint(1000.0 / measured).astype(np.uint16)
    frame = RgbdFrame(0, Stamp(0), np.zeros((480, 640), np.uint8), Stamp(0), depth)
    sensor = sensor_of(camera)
    view = View.of(frame, 0, sensor.clock, FrameImages.of(frame.color))
    guess = wanted if seen_before else None
    found = measure(view, sensor, uv, np.zeros((50, 3)), np.zeros(6), guess)
    np.testing.assert_allclose(found.values[:, 2], wanted, atol=1e-3)
    image = 1000.0 / np.maximum(corrected_depth(depth, ERRING), 1)
    np.testing.assert_allclose(image[60:420, 60:580], true[60:420, 60:580], atol=2e-3)
    by_exact = measure(view, sensor_of(replace(camera, depth=DepthModel())), uv, np.zeros((50, 3)), np.zeros(6), guess)
    assert np.median(np.abs(by_exact.values[:, 2] - wanted)) > 5e-3


def test_its_repr_names_what_differs_from_exact_depth_and_makes_it_again():
    assert repr(DepthModel()) == "DepthModel()"
    model = DepthModel(shift_px=(4.0, -2.0), scale=(1.02, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert repr(model) == "DepthModel(shift_px=(4.0, -2.0), scale=(1.02, 0.0, 0.0, 0.0, 0.0, 0.0))"
    assert eval(repr(model)) == model
